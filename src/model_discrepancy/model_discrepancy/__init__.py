"""Physics that a joint model leaves out is located, named, modelled and shown to be missing.

No ROS.
"""

import os

# The matrices are tall and narrow: several BLAS threads wait for each other (3 to 15 times slower
# on a busy machine). It takes effect where this package is imported before numpy, as its commands
# do.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
