"""Going on with a run that was cut short, from its bag."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from limb_nodes.errors import FieldError, UserError
from limb_nodes.exchange.identity import is_identity
from limb_nodes.exchange.recorded import RecordedRun
from limb_nodes.foundation.topics import NODES, STATES
from limb_nodes.nodes.settings import RunSettings


def resumed(settings: RunSettings, bag: str) -> RunSettings:
    """The settings with which a recorded run goes on.

    settings: give the new bag and how to run; limb and source too, if they are elsewhere now. Raises UserError if the
    bag is not of a lockstep run, FieldError if limb or source have to be given.
    """
    run = RecordedRun.read(bag)
    told = run.info["parameters"]
    if missing := [node for node in NODES if not isinstance(told.get(node), dict)]:
        raise UserError(f"{bag}: run_info lacks the parameters of {', '.join(missing)}; a bag of limb run is needed")
    if told["limb_dynamics"].get("mode") != "lockstep":
        raise UserError(f"{bag}: is of a run in real time; only one in lockstep can go on")
    limb = settings.limb or str(run.info.get("limb_file", ""))
    if not Path(limb).is_file() or Path(limb).read_text(encoding="utf-8", errors="replace") != run.info["limb"]:
        raise FieldError("limb", f"is {limb or 'missing'}; the file of the limb that {bag} was recorded of is needed")
    stack, source = told["muscle_stack"], told["activation_input"]
    try:
        return replace(
            settings,
            limb=limb,
            source=settings.source or str(source["source"]),
            duration=float(source["duration"]),
            rate=float(told["limb_dynamics"]["rate"]),
            mode="lockstep",
            namespace=run.namespace.strip("/"),
            states=tuple(topic for topic in STATES if stack.get(f"publish_{topic}", True)),
            state_every=int(stack["state_every"]),
            identity=identity_of_nodes(told),
            resume=bag,
        )
    except (KeyError, TypeError, ValueError):
        raise UserError(f"{bag}: the parameters in its run_info are not those of limb run, which are needed") from None


def identity_of_nodes(parameters: dict[str, Any]) -> str:
    """The identity that a run's nodes were given. Raises ValueError if there is none."""
    identity = str(parameters["limb_dynamics"]["identity"])
    if not is_identity(identity):
        raise ValueError("no identity")
    return identity
