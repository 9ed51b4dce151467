"""Measure the product beside its peers: python tests/benchmarks/run.py [--quick] [--only NAME] [--json FILE].

Needs the extra `bench` (pip install '.[bench]'). Takes the package from this checkout.
"""

import runpy
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])
    runpy.run_module("tests.benchmarks.command", run_name="__main__", alter_sys=True)
