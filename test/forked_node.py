"""What a process does that is forked to be a node: in a module that the process can import."""

import os
import sys
from importlib import import_module


def run_node(module, parameters, environment, output):
    """Be a process of the node; what it writes goes to a file."""
    with open(output, "w") as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
    os.environ.update(environment)
    sys.argv = [module, "--ros-args", *(word for one in parameters for word in ("-p", one))]
    sys.exit(import_module(module).main())
