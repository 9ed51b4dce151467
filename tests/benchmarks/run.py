"""Measure the product beside its peers: python tests/benchmarks/run.py [--quick] [--only NAME] [--json FILE].

Needs the extra `bench` (pip install '.[bench]'). Takes the package from this checkout.
"""

import runpy
import sys
from pathlib import Path

if __name__ == "__main__":
    here = Path(__file__).resolve()
    sys.path[:1] = [str(here.parents[2]), str(here.parents[1])]
    runpy.run_module("benchmarks.command", run_name="__main__", alter_sys=True)
