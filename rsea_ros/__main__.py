"""Run a verb: `python -m rsea_ros VERB …`."""

import signal
import sys


def run() -> int:
    """Run it, and let no signal disturb the end of the interpreter."""
    try:
        from rsea_ros.cli.main import main

        return main()
    except KeyboardInterrupt:  # before main() could say so
        sys.stderr.write("rsea: interrupted\n")
        return 130
    finally:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)


if __name__ == "__main__":
    sys.exit(run())
