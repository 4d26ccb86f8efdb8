"""One thread for linear algebra in the programs of this package.

Matrices here are small and the program's threads use the cores: a second pool only gets in the way. A
library must not change its user's environment, so only the command line and the nodes call this.
"""

import os

VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread_for_blas() -> None:
    """Request one thread, unless the user has set another number. Must run before numpy is imported."""
    for name in VARIABLES:
        os.environ.setdefault(name, "1")
