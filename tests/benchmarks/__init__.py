"""Measures the product beside its peers: `python tests/benchmarks/run.py --help`."""
