"""A short run of fuzz.py, always the same cases for the same options."""
import sys

import fuzz

sys.exit(fuzz.main(["--seed", "1", "--cases", "150"]))
