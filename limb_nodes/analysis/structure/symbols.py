"""The report's symbols of the variables, for tables and pictures."""

from __future__ import annotations

import re

SYMBOLS = {
    "optimal_sarcomere_length": "l_S^opt",
    "maximum_sarcomere_length": "l_S^max",
    "minimum_sarcomere_length": "l_S^min",
    "maximum_sarcomere_force": "F_S^max",
    "bound_probability": "w",
    "saturated_velocity": "V^max,inf",
    "unhindered_michaelis_constant": "K_m^0",
    "adp_inhibition_constant": "K_i",
    "michaelis_constant": "K_m",
    "maximum_sarcomere_velocity": "V^max",
    "sarcomere_velocity_norm": "v_S^norm",
    "sarcomere_force": "F_S",
    "sarcomere_length": "l_S",
    "sarcomere_velocity": "v_S",
    "sarcomere_frequency": "f_S",
    "optimal_fibre_length": "l_F^opt",
    "maximum_fibre_length": "l_F^max",
    "minimum_fibre_length": "l_F^min",
    "maximum_fibre_force": "F_F^max",
    "fibre_length_norm": "l_F^norm",
    "frequency_norm": "f_F^norm",
    "force_length_factor": "FL",
    "force_frequency_factor": "FF",
    "passive_force_factor": "F_PE",
    "maximum_passive_force": "F_PE^max",
    "fibre_force": "F_F",
    "fibre_length": "l_F",
    "fibre_velocity": "v_F",
    "stimulation_frequency": "f_F",
    "minimum_frequency": "f_F^min",
    "maximum_frequency": "f_F^max",
    "pcsa": "PCSA_F",
    "unit_threshold": "U_th,i",
    "unit_rank": "R_F",
    "muscle_pcsa": "PCSA_M",
    "excitation": "U_in",
    "activation": "U",
    "muscle_tendon_length": "l_M+T",
    "muscle_tendon_velocity": "v_M+T",
    "path_slope": "-dl/dα",
    "moment_arm": "r_M",
    "muscle_length": "l_M",
    "muscle_velocity": "v_M",
    "pennation_angle": "θ_penn",
    "aponeurosis_angle": "β_AM",
    "fibre_angle": "α_FM",
    "total_fibre_force": "F_F*",
    "muscle_force": "F_M",
    "aponeurosis__area": "A",
    "tendon_length": "l_T",
    "tendon_velocity": "v_T",
    "tendon_force": "F_T",
    "muscle_torque": "M_M",
    "aponeurosis_length": "l_A",
    "aponeurosis_velocity": "v_A",
    "aponeurosis_force": "F_A",
    "joint_angle": "α",
    "joint_velocity": "ω",
    "segment_angle": "α^s",
    "segment_velocity": "ω^s",
    "joint_torque": "M_L",
    "passive_moment": "M_P",
    "tip_torque": "M_load",
} | {
    f"{name}_{axis}": symbol
    for name, symbol in (
        ("com_position", "s"),
        ("com_velocity", "v"),
        ("com_acceleration", "a"),
        ("joint_force", "F_L"),
        ("tip_force", "F_load"),
    )
    for axis in "xy"
}
GREEK = {"α": r"\alpha", "β": r"\beta", "θ": r"\theta", "ω": r"\omega"}


def symbol(name: str) -> str:
    """The symbol of a variable, its own name if the report has none; of several joints with the joint's number."""
    whole, _, number = name.rpartition("_")
    if number.isdigit() and whole in SYMBOLS:
        return f"{SYMBOLS[whole]},{int(number) + 1}"
    return SYMBOLS.get(name, name)


def mathtext(text: str) -> str:
    """A symbol for matplotlib: one letter with sub- and superscripts in italics, all else upright."""
    parts = re.fullmatch(r"(\(?)(-?)([^\W\d_]{1,4})(_[^^*]+)?(\^.+)?(\*?)(\)?)", text)
    if not parts:
        return text
    opening, sign, base, low, high, star, closing = parts.groups()
    letter = GREEK.get(base, base if len(base) == 1 else rf"\mathrm{{{base}}}")
    low = rf"_{{\mathrm{{{low[1:]}}}}}" if low else ""
    if high == "^s":
        high = "^{s}"
    else:
        high = rf"^{{\mathrm{{{high[1:]}}}}}" if high else ("^{*}" if star else "")
    return f"${opening}{sign}{letter}{low}{high}{closing}$"
