"""The command line: one verb a file, see main.py."""

from rsea_ros.one_thread import one_thread_for_blas

one_thread_for_blas()  # before numpy is imported by any verb
