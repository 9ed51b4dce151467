"""The choice of a law: by name from the registry, or by import path from the user's own code."""

from __future__ import annotations

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.foundation.section import Section, one_line
from limb_nodes.levels import CONTRACTS, REGISTRY, Law
from limb_nodes.model.chosen import ChosenLaw
from limb_nodes.model.user_code import import_user_module, user_folders


def choose_law(section: Section, key: str, process: str, shared: tuple[Parameter, ...] = ()) -> ChosenLaw:
    """Read the law of a process under `key` of a section.

    The value is a mapping with `law` and the law's parameters, or only the law's name.
    `shared` are parameters that every law of the process has.
    """
    contract = CONTRACTS[process]
    if not section.has(key):
        section.take(key)
        chosen = Section(section.file, section.at(key), {"law": contract.absent or contract.default})
    elif isinstance(section.content[key], str):
        chosen = Section(section.file, section.at(key), {"law": section.take(key)})
    else:
        chosen = section.section(key)
    return read_law(chosen, process, shared)


def read_law(section: Section, process: str, shared: tuple[Parameter, ...] = ()) -> ChosenLaw:
    """Read law and parameters from a section that holds nothing else."""
    law, module = find_law(section, process)
    values: dict[str, float] = {}
    parameters = (*shared, *law.parameters)
    for parameter in parameters:
        value = section.number(parameter)
        if value is not None:
            values[parameter.name] = value
    for parameter in parameters:
        if parameter.name not in values and isinstance(parameter.default, str):
            values[parameter.name] = values[parameter.default]
    section.finish()
    return ChosenLaw(law, values, section.place, module)


def find_law(section: Section, process: str) -> tuple[Law, str]:
    """The law that `section.law` names, and the user's module it is in; UserError where there is none."""
    known = REGISTRY[process]
    name = section.text("law", CONTRACTS[process].default)
    if name in known:
        return known[name], ""
    if ":" not in name:
        section.fail(
            "law",
            f"is {name!r}; allowed: {', '.join(sorted(known))}, or an import path module:name",
        )
    module_name, _, attribute = name.partition(":")
    module_name = module_name.removesuffix(".py")
    try:
        module = import_user_module(module_name, user_folders(section.file))
    except Exception as problem:
        section.fail("law", f"is {name!r}; it cannot be imported: {one_line(problem) or type(problem).__name__}")
    found = getattr(module, attribute, None)
    if not isinstance(found, Law):
        section.fail("law", f"is {name!r}; {attribute} in {module_name} is no law")
    elif found.process != process:
        section.fail("law", f"is {name!r}, a law of {found.process}; a law of {process} is needed")
    assert isinstance(found, Law)
    return found, module_name
