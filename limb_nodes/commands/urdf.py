"""`limb urdf`: print a limb as URDF."""

from __future__ import annotations

import argparse
from pathlib import Path

from limb_nodes.foundation.yaml_text import read_yaml
from limb_nodes.model import outline
from limb_nodes.model.urdf import urdf


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the arguments of `limb urdf`."""
    parser = subparsers.add_parser(
        "urdf",
        help="print a limb as URDF",
        description="Print a limb's segments and joints as URDF, the description of robots that RViz, "
        "robot_state_publisher and ros2_control read. Laws are not run.",
    )
    parser.add_argument("limb", metavar="LIMB.yaml", help="the limb")


def run(args: argparse.Namespace) -> int:
    """Print it."""
    _, text = read_yaml(Path(args.limb))
    print(urdf(outline(text, args.limb)))
    return 0
