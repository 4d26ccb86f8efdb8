"""The command line: one verb a file, see main.py."""

from rsea_ros.processes import one_thread_for_blas

one_thread_for_blas()  # before numpy is imported by any verb
