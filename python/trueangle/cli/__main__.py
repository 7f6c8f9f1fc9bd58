"""``python -m trueangle.cli``."""

import sys

from . import main

sys.exit(main())
