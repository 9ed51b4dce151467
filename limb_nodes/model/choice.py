"""The choice of a law: by name from the registry, or by import path from the user's own code."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from limb_nodes.errors import MOST_PATH
from limb_nodes.foundation.parameter import is_finite
from limb_nodes.foundation.section import Section, one_line
from limb_nodes.levels import CONTRACTS, REGISTRY, Law
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.spanning import READERS
from limb_nodes.model.system import all_parameters
from limb_nodes.model.user_code import UserCode, module_of


def choose_law(
    section: Section, process: str, code: UserCode | None, named: Mapping[str, Section] = MappingProxyType({})
) -> ChosenLaw:
    """Read the law of a process from the key of its name. Raises UserError.

    code: the user's own; without it a law of the user's own stays unread, and none of its code runs.

    The value is a mapping with `law` and the law's parameters, the law's name alone, or, for a
    sarcomere, the name of one of the mappings in `named`.
    """
    contract = CONTRACTS[process]
    value = section.take(process)
    if value is None:
        chosen = Section(section.file, section.at(process), {"law": contract.absent or contract.default})
    elif isinstance(value, str):
        chosen = Section(section.file, section.at(process), {"law": value})
        if process == "sarcomere" and value in named:
            chosen = Section(section.file, named[value].place, named[value].content)
    else:
        chosen = section.section(process)
    return read_law(chosen, process, code)


def read_law(section: Section, process: str, code: UserCode | None) -> ChosenLaw:
    """Read law and parameters from a section that holds nothing else."""
    law, module = find_law(section, process, code)
    if code is None and module:
        # True and False are no numbers here.
        numbers = {key: value for key, value in section.content.items() if type(value) in (int, float)}
        finite = {key: float(value) for key, value in numbers.items() if is_finite(value)}
        return ChosenLaw(law, finite, section.place, module)
    values: dict[str, float] = {}
    parameters = all_parameters(law)
    for parameter in parameters:
        value = section.number(parameter)
        if value is not None:
            values[parameter.name] = value
    for parameter in parameters:
        if parameter.name not in values and isinstance(parameter.default, str):
            values[parameter.name] = values[parameter.default]
    section.finish()
    return ChosenLaw(law, values, section.place, module)


def find_law(section: Section, process: str, code: UserCode | None) -> tuple[Law, str]:
    """The law that `section.law` names, and the user's module that it is in. Raises UserError.

    Without the user's code, a law of its own is one without equations.
    """
    known = REGISTRY[process]
    name = section.text("law", CONTRACTS[process].default, MOST_PATH)
    if name in known:
        return known[name], ""
    if ":" not in name:
        allowed = ", ".join(sorted({*known, *(READERS if process == "path" else ())}))
        section.fail("law", f"is {name!r}; allowed: {allowed}, or an import path module:name")
    module_name, attribute = module_of(name), name.partition(":")[2]
    if code is None:
        return Law(process, attribute, ()), module_name
    try:
        module = code.load(module_name)
    except Exception as problem:
        reason = one_line(problem) or type(problem).__name__
        section.fail("law", f"is {name!r}; it cannot be imported: {reason}")
    law = getattr(module, attribute, None)
    if not isinstance(law, Law):
        where = getattr(module, "__file__", None) or "memory"
        section.fail("law", f"is {name!r}; a law is needed, which {attribute} in {module_name} ({where}) is not")
    elif law.process != process:
        section.fail("law", f"is {name!r}, a law of {law.process}; a law of {process} is needed")
    assert isinstance(law, Law)
    return law, module_name
