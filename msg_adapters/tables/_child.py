"""A separate program: `_child.py READER FILE LIMIT PLACES` runs a reader within its limits.

See child.py. It imports nothing of this package, so that it starts fast and may be killed at any moment.
"""

import json
import os
import resource
import runpy
import sys
import warnings
from typing import Any


def main(reader: dict[str, Any], path: str, limit: int, places: list[dict[str, Any]]) -> None:
    """Write sizes and numbers, or one line with the reason of a failure."""
    memory, seconds = reader["MEMORY"], reader["SECONDS"]
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    try:
        sizes, vectors = reader["read"](path, limit, places)
        answer({"sizes": sizes})
        for vector in vectors:
            sys.stdout.buffer.write(vector.tobytes())
    except KeyError as error:
        answer({"column": error.args[0], "names": error.args[-1]})
    except MemoryError:
        answer({"error": f"asks for more than {memory >> 30} GB of memory"})
    except reader["Refused"] as error:
        answer({"error": str(error)})
    except Exception:  # a damaged file may raise anything in the reader
        answer({"error": reader["DAMAGED"]})


def answer(words: dict[str, object]) -> None:
    """Write a line that replaces all earlier output."""
    sys.stdout.buffer.flush()
    os.ftruncate(1, 0)
    os.lseek(1, 0, os.SEEK_SET)
    sys.stdout.buffer.write(json.dumps(words).encode() + b"\n")


if __name__ == "__main__":
    reader = runpy.run_path(sys.argv[1])
    if "read" in reader:  # a file without it gives no answer, which child.py says
        main(reader, sys.argv[2], int(sys.argv[3]), json.loads(sys.argv[4]))
