"""Run a verb: `python -m rsea_ros VERB …`."""

import sys

from rsea_ros.cli.main import main

sys.exit(main())
