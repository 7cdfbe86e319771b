"""The verbs of the `ankle` command, one file each.

A file `two_words.py` is the verb ``ankle two-words``; a name that Python reserves ends in an
underscore, as in `import_.py`. The file has a function `verb`: its arguments are the verb's
arguments and options, its docstring is the help and ends with an example. A verb that returns its
result (plain data, arrays, dataclasses) has the option ``--json``; each has ``--quiet``. Options
that several verbs share are in `ankle_bringup.terminal`. A verb of several words, such as
``ankle rig arm``, has a `typer.Typer` by the name `verb`.

Import what takes long inside the function: ``ankle --help`` imports every file.
"""
