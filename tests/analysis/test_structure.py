"""What `limb structure` finds: indices, blocks, the report's tables, and what is to blame for an unsolvable system."""

import argparse
import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import pytest

from limb_nodes.analysis.structure import analyse, structure_matrix
from limb_nodes.analysis.structure.levels import equation_sets
from limb_nodes.analysis.structure.matrix import MARKS
from limb_nodes.analysis.structure.muscles import muscle_assembly
from limb_nodes.analysis.structure.table import matrix_lines, report
from limb_nodes.commands import structure
from limb_nodes.errors import UserError
from limb_nodes.levels import CONTRACTS, MUSCLE_PROCESSES, REGISTRY, UNIT_PROCESSES, Law, State, equation
from limb_nodes.levels.muscle.tendon import INITIAL_LENGTH, LENGTH_STATE, SLACK_LENGTH
from limb_nodes.model import ChosenLaw, load_limb
from limb_nodes.model.system import muscle_system, unit_system

ROOT = Path(__file__).parents[2]
PARAMS = ROOT / "params"
LIMBS = sorted(path.stem for path in PARAMS.glob("*.yaml") if "segments:" in path.read_text(encoding="utf-8"))
DOCS = ROOT / "docs" / "structure.md"


def limb_of(name):
    return load_limb(PARAMS / f"{name}.yaml")


def levels_of(limb, name):
    return [one for one in analyse(limb) if one.system.name == name]


def level_of(limb, name):
    return levels_of(limb, name)[0]


def with_law(limb, process, law, values):
    """A limb whose first muscle, or all of whose motor units, have another law, without any check."""
    chosen = ChosenLaw(law, values, "test")
    first, *rest = limb.muscles
    if process in first.laws:
        first = replace(first, laws={**first.laws, process: chosen})
    else:
        first = replace(first, units=tuple(replace(unit, laws={**unit.laws, process: chosen}) for unit in first.units))
    return replace(limb, muscles=(first, *rest))


def labels(one, indices):
    return [one.system.relations[i].label for i in indices]


# --- what is found for every limb ------------------------------------------------------------------------------------


def test_there_are_limbs_with_tendons_without_and_with_pennation():
    assert {"reference_joint", "reference_joint_tendon", "pennate_leg"} <= set(LIMBS)


@pytest.mark.parametrize("name", LIMBS)
def test_every_level_is_determined_and_has_the_index_that_the_report_states(name):
    limb = limb_of(name)
    expected = {
        "sarcomere": 1,
        "motor_unit": 1,
        "muscle": 1,
        "tendon": 1,
        "aponeurosis": 1,
        "muscle_assembled": 1,
        "limb_original": 3,
        "limb_transformed": 0,
        "model": 1,
    }
    found = analyse(limb)
    pennate = any(muscle.laws["aponeurosis"].law.states for muscle in limb.muscles)
    assert {one.system.name for one in found} == set(expected) - (set() if pennate else {"aponeurosis"})
    for one in found:
        assert one.degrees_of_freedom == 0
        assert not one.singular
        assert one.index == expected[one.system.name]
        assert not one.undefined
        assert not one.defined_twice
    transformed = level_of(limb, "limb_transformed")
    assert transformed.kind == "ordinary differential equations"
    assert len(transformed.system.relations) == 2 * len(limb.segments)


@pytest.mark.parametrize("name", LIMBS)
def test_the_original_form_is_differentiated_at_the_positions(name):
    limb = limb_of(name)
    n = len(limb.segments)
    original = level_of(limb, "limb_original")
    times = {}
    for i, count in original.differentiated.items():
        times.setdefault(original.system.relations[i].label, set()).add(count)
    assert times == {"2.65": {2}, "2.59": {1}, "2.56": {1}}
    assert sum(r.level == "limb_original" for r in original.system.relations) == 13 * n
    (block,) = original.loops
    assert len(block.relations) == 10 * n
    # Both forms leave the same freedom: angle and velocity of every joint.
    transformed = level_of(limb, "limb_transformed")
    assert original.offsets.free_initial_values == transformed.offsets.free_initial_values == 2 * n
    first_rows, first_unknowns = original.offsets.constraints[0]
    assert labels(original, [i for i, _ in first_rows]) == ["2.65"]
    assert first_unknowns == ()


@pytest.mark.parametrize("name", LIMBS)
def test_the_equations_are_those_that_the_program_binds(name):
    limb = limb_of(name)
    assembly = muscle_assembly(limb)
    for muscle in limb.muscles:
        systems = [(muscle.name, muscle_system({p: muscle.laws[p].law for p in MUSCLE_PROCESSES}))]
        for unit in muscle.units:
            owner = f"{muscle.name}.{unit.name}"
            systems.append((owner, unit_system({p: unit.laws[p].law for p in UNIT_PROCESSES})))
        for owner, system in systems:
            expected = {(b.equation.number, b.defines, b.symbols) for b in system.equations}
            expected |= {(state.number, state.name, (state.rate,)) for state, _ in system.states}
            found = {
                (r.number, r.defines.variable.name, tuple(term.variable.name for term in r.uses))
                for r in assembly.relations
                if r.owner == owner
            }
            sums = {"2.37", "2.42", "2.36 threshold"}
            assert {row for row in found if row[0] not in sums} == {
                (number, defines, tuple(dict.fromkeys(symbols))) for number, defines, symbols in expected
            }


# --- algebraic loops --------------------------------------------------------------------------------------------------


def test_the_loop_of_a_muscle_with_tendon_is_one_block():
    muscle = level_of(limb_of("reference_joint_tendon"), "muscle_assembled")
    (loop,) = muscle.loops
    assert sorted(labels(muscle, loop.relations)) == sorted(
        ["2.11", "2.12", "2.14", "2.25", "2.30", "2.37", "2.38 parallel", "2.50", "2.53", "parallel fibre velocity"]
    )
    assert {variable.name for variable, order in loop.unknowns if order == 0} == {
        "sarcomere_velocity_norm",
        "sarcomere_force",
        "sarcomere_velocity",
        "fibre_force",
        "tendon_velocity",
        "total_fibre_force",
        "muscle_force",
        "muscle_velocity",
        "tendon_force",
        "fibre_velocity",
    }
    for i, (variable, _) in zip(loop.relations, loop.unknowns, strict=True):
        assert muscle.system.relations[i].defines.variable == variable


def test_a_rigid_tendon_leaves_no_loop():
    limb = limb_of("reference_joint")
    assert level_of(limb, "muscle_assembled").loops == []
    assert level_of(limb, "model").loops == []


def test_the_whole_model_has_the_loop_of_every_muscle_and_the_inertia_matrix():
    limb = limb_of("pennate_leg")
    model = level_of(limb, "model")
    owners = [{model.system.relations[i].owner.split(".")[0] for i in block.relations} for block in model.loops]
    for muscle in limb.muscles:
        assert owners.count({muscle.name}) == 1
    inertia = [block for block in model.loops if labels(model, block.relations) == ["3.11"] * 3]
    assert len(inertia) == 1
    assert len(model.loops) == len(limb.muscles) + 1
    pennate = next(block for block, owner in zip(model.loops, owners, strict=True) if owner == {"SOL"})
    assert {"2.30", "2.32", "2.35", "2.55"} <= set(labels(model, pennate.relations))
    states = 2 * 3 + len(limb.muscles) + 1
    assert model.offsets.free_initial_values == states


def test_blocks_come_in_an_order_in_which_they_can_be_solved():
    model = level_of(limb_of("arm"), "model")
    known = set()
    for block in model.blocks:
        known |= set(block.unknowns)
        for i in block.relations:
            for variable, order in model.incidences[i].items():
                state = model.offsets.highest[variable] > order
                assert state or (variable, order) in known
    assert len(known) == len(model.system.unknowns)


# --- exchanged laws ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("process", "name"),
    [
        (process, name)
        for process, laws in REGISTRY.items()
        for name in laws
        if ":" not in name and CONTRACTS[process].owner != "joint"
    ],
)
def test_every_law_keeps_the_model_determined_with_index_one(process, name):
    limb = with_law(limb_of("reference_joint_tendon"), process, REGISTRY[process][name], {})
    found = analyse(limb)
    for one in found:
        assert one.degrees_of_freedom == 0, one.system.name
        assert not one.singular
        assert one.index == {"limb_original": 3, "limb_transformed": 0}.get(one.system.name, 1)
    assert name in {law for one in found for law in one.system.laws.values()}


def test_states_of_a_law_appear_in_its_level():
    @equation("relaxing rate", "relaxed_rate")
    def relaxed_rate(relaxed: float, sarcomere_velocity: float) -> float:
        return sarcomere_velocity - relaxed

    @equation("relaxing force", "sarcomere_force")
    def force(relaxed: float) -> float:
        return relaxed

    @equation("relaxing maximum", "maximum_sarcomere_force")
    def maximum() -> float:
        return 1.0

    functions = (relaxed_rate, force, maximum)
    law = Law("sarcomere", "relaxing", functions, states=(State("relaxed", "relaxed_rate", "relaxing", "x", 1.0),))
    limb = with_law(limb_of("reference_joint_tendon"), "sarcomere", law, {})
    sarcomere = level_of(limb, "sarcomere")
    assert sarcomere.kind == "differential and algebraic equations"
    assert (sarcomere.index, sarcomere.degrees_of_freedom) == (1, 0)
    # A force that is a state cuts the loop.
    assert level_of(limb, "muscle_assembled").loops == []


@equation("spring", "tendon_force")
def spring_force(tendon_length: float, slack_length: float) -> float:
    """A tendon without damper, its force by its length: the velocity is defined by nothing."""
    return slack_length - tendon_length


SPRING = Law("tendon", "spring", (spring_force,), (SLACK_LENGTH, INITIAL_LENGTH), (LENGTH_STATE,), "test")


@equation("constant velocity", "tendon_velocity")
def constant_velocity() -> float:
    return 0.0


@equation("fixed length", "tendon_length")
def fixed_length(slack_length: float) -> float:
    return slack_length


def test_a_law_that_leaves_a_variable_without_equation_is_named():
    missing = Law("tendon", "missing", (), (SLACK_LENGTH, INITIAL_LENGTH), (LENGTH_STATE,), "test")
    muscle = level_of(with_law(limb_of("reference_joint_tendon"), "tendon", missing, {}), "muscle_assembled")
    assert muscle.singular
    assert muscle.index is None
    assert muscle.degrees_of_freedom == 1
    assert [variable.name for variable in muscle.undefined] == ["tendon_velocity"]
    equations, unknowns = muscle.parts.under
    assert "tendon_velocity" in {variable.name for variable in unknowns}
    assert "2.31" in labels(muscle, equations)
    assert muscle.parts.over == ((), ())
    text = report([muscle], "test", 100)
    assert "structurally singular" in text
    assert "v_T (tendon_velocity) is defined by no equation" in text
    assert "under-determined" in text


def test_a_law_that_defines_a_variable_twice_is_named():
    twice = Law(
        "tendon",
        "twice",
        (*REGISTRY["tendon"]["voigt"].equations, constant_velocity),
        REGISTRY["tendon"]["voigt"].parameters,
        (LENGTH_STATE,),
        "test",
    )
    tendon = level_of(with_law(limb_of("reference_joint_tendon"), "tendon", twice, {}), "tendon")
    assert tendon.singular
    assert tendon.degrees_of_freedom == -1
    ((variable, equations),) = tendon.defined_twice.items()
    assert variable.name == "tendon_velocity"
    assert [relation.label for relation in equations] == ["2.30", "constant velocity"]
    over, unknowns = tendon.parts.over
    assert {"2.30", "constant velocity"} <= set(labels(tendon, over))
    assert "tendon_velocity" in {v.name for v in unknowns}
    text = report([tendon], "test", 100)
    assert "v_T (tendon_velocity) is defined more than once: by 2.30, constant velocity" in text
    assert "over-determined" in text


def test_a_length_that_is_fixed_and_a_state_has_index_two():
    fixed = Law("tendon", "fixed", (fixed_length,), (SLACK_LENGTH, INITIAL_LENGTH), (LENGTH_STATE,), "test")
    tendon = level_of(with_law(limb_of("reference_joint_tendon"), "tendon", fixed, {}), "tendon")
    assert tendon.degrees_of_freedom == 0
    assert tendon.index == 2
    assert labels(tendon, tendon.differentiated) == ["fixed length"]
    assert tendon.offsets.free_initial_values == 0
    text = report([tendon], "test", 100)
    assert "to be differentiated: fixed length once" in text
    assert "constraint: fixed length holds nothing but states" in text


def test_a_spring_alone_is_solved_for_its_velocity_through_the_muscle():
    muscle = level_of(with_law(limb_of("reference_joint_tendon"), "tendon", SPRING, {}), "muscle_assembled")
    assert (muscle.degrees_of_freedom, muscle.index) == (0, 1)
    assert [v.name for v in muscle.undefined] == ["tendon_velocity"]
    assert [v.name for v in muscle.defined_twice] == ["tendon_force"]


def test_a_spring_against_a_force_that_does_not_depend_on_velocity_has_a_high_index():
    limb = with_law(limb_of("reference_joint_tendon"), "tendon", SPRING, {})
    limb = with_law(limb, "sarcomere", REGISTRY["sarcomere"]["constant"], {})
    limb = with_law(limb, "force_length", REGISTRY["force_length"]["constant"], {})
    muscle = level_of(limb, "muscle_assembled")
    assert muscle.index == 2
    assert "spring (tendon)" in labels(muscle, muscle.differentiated)
    assert "2.53" in labels(muscle, muscle.differentiated)


# --- the report's tables ----------------------------------------------------------------------------------------------


def report_tables():
    """The module with the tables beside this one."""
    spec = importlib.util.spec_from_file_location("report_structure", Path(__file__).with_name("report_structure.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pennate_matrix(level):
    """Our matrix of a level for a pennate muscle with a Voigt tendon."""
    found = levels_of(limb_of("pennate_leg"), level)
    if level == "muscle":
        found = [one for one in found if one.system.laws["aponeurosis"] == "constant_area"]
    (one,) = found
    return structure_matrix(one.system)


def differences(level):
    """Every cell, row and heading in which our matrix differs from the report's: (equation, variable, report, here)."""
    tables = report_tables()
    table, given, matrix = tables.TABLES[level], tables.GIVEN[level], pennate_matrix(level)
    found = set()
    for row in {*table, *matrix.rows}:
        here = {column: MARKS[mark] for (label, column), mark in matrix.entries.items() if label == row}
        if row not in table or row not in matrix.rows:
            found.add((row, "row", "row" if row in table else "-", "row" if row in matrix.rows else "-"))
            continue
        for column in {*table[row], *here}:
            cells = table[row].get(column, "-"), here.get(column, "-")
            if cells[0] != cells[1]:
                found.add((row, column, *cells))
    for column in {c for cells in table.values() for c in cells} & set(matrix.columns):
        if (column in given) != (column in matrix.external):
            found.add(("heading", column, *(("given", "own") if column in given else ("own", "given"))))
    return found


def listed_differences(level):
    """Those that docs/structure.md lists, each with a reason."""
    found = set()
    for line in DOCS.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 6 and cells[0] == f"`{level}`":
            assert cells[5], f"{line}: without reason"
            assert tuple(cells[1:5]) not in found, f"{line}: listed twice"
            found.add(tuple(cells[1:5]))
    return found


@pytest.mark.parametrize(
    "level",
    ["sarcomere", "motor_unit", "muscle", "tendon", "aponeurosis", "limb_original", "limb_transformed"],
)
def test_the_matrix_is_the_reports_but_for_the_differences_that_the_docs_list(level):
    assert differences(level) == listed_differences(level)


def test_the_reports_cells_are_for_the_most_part_ours():
    tables = report_tables().TABLES
    cells = [(level, row, c, m) for level, t in tables.items() for row, cs in t.items() for c, m in cs.items()]
    same = 0
    for level in tables:
        matrix = pennate_matrix(level)
        same += sum(
            MARKS.get(matrix.entries.get((row, column), ""), "-") == mark
            for one, row, column, mark in cells
            if one == level
        )
    assert (same, len(cells)) == (113, 148)


@pytest.mark.parametrize(
    ("level", "count"),
    [("motor_unit", 13), ("tendon", 4), ("aponeurosis", 3), ("sarcomere", 12), ("muscle", 15 + 2 * 4)],
)
def test_numbers_of_equations(level, count):
    found = levels_of(limb_of("pennate_leg"), level)
    assert len(found[-1].system.relations) == count


def test_what_the_contract_offers_and_the_law_leaves_is_marked():
    matrix = pennate_matrix("sarcomere")
    offered = {column for (row, column), mark in matrix.entries.items() if mark == "offered"}
    assert offered == {"l_S", "f_S"}
    assert set(CONTRACTS["sarcomere"].given) >= {"sarcomere_length", "sarcomere_frequency"}


# --- text, JSON and picture -------------------------------------------------------------------------------------------


def limb_structure(*arguments):
    parser = argparse.ArgumentParser()
    structure.add_parser(parser.add_subparsers())
    return structure.run(parser.parse_args(["structure", *map(str, arguments)]))


def test_the_text_fits_the_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    assert limb_structure(PARAMS / "pennate_leg.yaml") == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 100
    assert any("index 3" in line for line in lines)
    assert any("ordinary differential equations" in line for line in lines)
    assert "to be differentiated: 2.65 [6] twice; 2.56 [3], 2.59 [6] once" in lines


def test_a_wide_matrix_is_split_and_loses_no_entry():
    matrix = pennate_matrix("muscle")
    text = "\n".join(matrix_lines(matrix, 60))
    assert text.count("⊗") == sum(mark == "defines" for mark in matrix.entries.values())
    assert text.count("×") == sum(mark == "uses" for mark in matrix.entries.values())


def test_one_level_only(capsys):
    assert limb_structure(PARAMS / "reference_joint.yaml", "--level", "model") == 0
    text = capsys.readouterr().out
    assert "whole model" in text
    assert "sub-level" not in text
    assert "(2.12)" in text
    with pytest.raises(UserError, match="level is aponeurosis; a level that a muscle of this limb has is needed"):
        limb_structure(PARAMS / "reference_joint.yaml", "--level", "aponeurosis")


def test_json_holds_everything_that_is_printed(capsys):
    assert limb_structure(PARAMS / "reference_joint_tendon.yaml", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["limb"] == "reference_joint_tendon"
    levels = {level["level"]: level for level in found["levels"]}
    original, model = levels["limb_original"], levels["model"]
    assert (original["index"], levels["limb_transformed"]["index"], model["index"]) == (3, 0, 1)
    twice = [original["equations"][d["equation"]]["number"] for d in original["differentiate"] if d["times"] == 2]
    assert sorted(twice) == ["2.65 x", "2.65 y"]
    loops = [block for block in model["blocks"] if len(block["equations"]) > 1]
    assert [len(block["equations"]) for block in loops] == [10, 10]
    assert {"variable": "flexor.tendon_velocity", "derivative": 0} in loops[0]["unknowns"] + loops[1]["unknowns"]
    assert sorted(model["inputs"]) == [
        "extensor.excitation",
        "flexor.excitation",
        "tip_force_x",
        "tip_force_y",
        "tip_torque",
    ]
    documented = DOCS.read_text(encoding="utf-8")
    for key in (*found, *model):
        assert f"`{key}`" in documented, key


def test_a_picture_of_the_matrices(tmp_path, capsys):
    out = tmp_path / "structure.png"
    assert limb_structure(PARAMS / "reference_joint_tendon.yaml", "-o", out) == 0
    assert str(out) in capsys.readouterr().out
    assert out.stat().st_size > 20_000


def test_a_picture_of_a_singular_system(tmp_path):
    from limb_nodes.analysis.structure.picture import draw_structure

    missing = Law("tendon", "missing", (), (SLACK_LENGTH, INITIAL_LENGTH), (LENGTH_STATE,), "test")
    limb = with_law(limb_of("reference_joint_tendon"), "tendon", missing, {})
    draw_structure(analyse(limb), limb.name, tmp_path / "singular.png")
    assert (tmp_path / "singular.png").stat().st_size > 20_000


def test_a_name_of_a_picture_that_cannot_be_drawn_is_refused_before_anything_is_done(tmp_path):
    with pytest.raises(UserError, match=r"out is matrix\.docx; a name that ends in \.png or \.pdf or \.svg"):
        limb_structure(tmp_path / "missing.yaml", "-o", "matrix.docx")
    with pytest.raises(UserError, match="a folder that exists is needed"):
        limb_structure(PARAMS / "reference_joint.yaml", "-o", tmp_path / "nowhere" / "matrix.png")


def test_a_system_that_cannot_be_solved_ends_with_status_1(monkeypatch, capsys):
    broken = with_law(limb_of("reference_joint_tendon"), "tendon", SPRING, {})
    monkeypatch.setattr(structure, "load_limb", lambda path, allow_laws: broken)
    monkeypatch.setenv("COLUMNS", "100")
    assert limb_structure("broken.yaml") == 1
    assert "F_T (tendon_force) is defined more than once: by 2.53, spring" in capsys.readouterr().out


def test_a_limb_without_muscles_has_the_levels_of_the_limb():
    limb = replace(limb_of("arm"), muscles=())
    found = analyse(limb)
    assert [one.system.name for one in found] == ["limb_original", "limb_transformed", "model"]
    assert [one.index for one in found] == [3, 0, 1]
    assert [one.name for one in equation_sets(limb, "model")] == ["model"]


def test_a_terminal_without_symbols_gets_letters(monkeypatch):
    class Plain:
        encoding = "ascii"

    monkeypatch.setattr(structure.sys, "stdout", Plain())
    assert structure.printable("⊗ × θ_penn → v_T") == "O x theta_penn > v_T"


def test_the_tissue_of_joints_is_there(tmp_path):
    """Each law's moment in the sum of the joint's torques, by angle and velocity as far as it uses them."""
    text = (PARAMS / "reference_joint.yaml").read_text()
    angle = "    angle: 0.5235987755982988"
    assert text.count(angle) == 1
    ends = "upper_angle: 1.0, upper_growth: 5.0, lower_angle: -1.0, lower_growth: 5.0"
    tissue = f"[{{law: exponential, {ends}}}, {{law: linear, stiffness: 1.0, damping: 0.1}}]"
    (tmp_path / "limb.yaml").write_text(text.replace(angle, f"    tissue: {tissue}\n{angle}"))
    found = {one.name: one for one in equation_sets(load_limb(tmp_path / "limb.yaml"))}
    plain = {one.name: one for one in equation_sets(load_limb(PARAMS / "reference_joint.yaml"))}
    for level in ("limb_original", "model"):
        relations = found[level].relations
        moments = [relation for relation in relations if relation.defines.variable.name == "passive_moment"]
        assert len(moments) == 2
        (total,) = (relation for relation in relations if relation.number == "2.61")
        assert {relation.defines for relation in moments} <= set(total.uses)
        assert all("joint_angle" in {term.variable.name for term in relation.uses} for relation in moments)
        assert len(relations) == len(found[level].unknowns)
        assert found[level].inputs == plain[level].inputs
    assert found["limb_original"].laws == {"tissue": "exponential, linear"}
