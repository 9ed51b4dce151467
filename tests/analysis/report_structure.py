"""The structure matrices of the report (2.1.4, 2.2.4, 2.3.4, 2.4.4), typed from it.

For each level: by equation the variable that it defines (⊗) and those that it uses (×); marks in parentheses are kept.
`given` are the columns that stand in parentheses: variables that another level defines.
"""

SARCOMERE = {
    "2.1": {"l_S^opt": "⊗"},
    "2.2": {"l_S^max": "⊗"},
    "2.3": {"l_S^min": "⊗"},
    "2.4": {"F_S^max": "⊗"},
    "2.5": {"w": "⊗"},
    "2.12": {"w": "×", "F_S": "⊗", "l_S": "(×)", "v_S": "×", "f_S": "(×)"},
}
UNIT = {
    "2.13": {"l_S": "⊗", "l_F": "×"},
    "2.14": {"v_S": "⊗", "v_F": "×"},
    "2.15": {"f_S": "⊗", "f_F": "×"},
    "2.16": {"l_F^opt": "⊗", "l_S^opt": "×"},
    "2.17": {"l_F^max": "⊗", "l_S^max": "×"},
    "2.18": {"l_F^min": "⊗", "l_S^min": "×"},
    "2.19": {"F_F^max": "⊗", "F_S^max": "×"},
    "2.20": {"l_F^opt": "×", "l_F^max": "×", "l_F^min": "×", "l_F^norm": "⊗", "l_F": "×"},
    "2.21": {"f_F^norm": "⊗", "f_F": "×"},
    "2.22": {"l_F^norm": "×", "FL": "⊗"},
    "2.23": {"f_F^norm": "×", "FF": "⊗"},
    "2.24": {"l_F^norm": "×", "F_PE": "⊗"},
    "2.25": {"F_F^max": "×", "FL": "×", "FF": "×", "F_PE": "×", "F_F": "⊗", "F_S": "×"},
}
MUSCLE = {
    "2.26": {"l_M+T": "×", "v_M+T": "⊗"},
    "2.34": {"l_M": "×", "v_M": "×", "l_A": "×", "v_A": "×", "θ_penn": "×", "l_F": "⊗"},
    "2.35": {"l_M": "×", "v_M": "×", "l_A": "×", "θ_penn": "×", "l_F": "×", "v_F": "⊗"},
    "2.36": {"f_F": "⊗", "PCSA_M": "×", "f_F^min": "×", "f_F^max": "×", "U": "×", "PCSA_F": "×"},
    "2.37": {"F_F*": "⊗", "F_F": "×"},
    "2.38": {"θ_penn": "×", "β_AM": "×", "F_F*": "×", "F_M": "⊗"},
    "2.40": {"l_M": "×", "θ_penn": "×", "β_AM": "⊗", "l_F": "×"},
    "2.41": {"l_M": "(×)", "l_A": "(×)", "θ_penn": "×", "β_AM": "×", "α_FM": "⊗"},
    "2.42": {"PCSA_M": "⊗", "PCSA_F": "×"},
    "2.43": {"l_M+T": "⊗", "α": "×"},
    "2.44": {"l_M+T": "⊗", "α": "×"},
    "2.45": {"l_M+T": "(×)", "v_M+T": "⊗", "α": "×", "ω": "×"},
    "2.47": {"l_M+T": "(×)", "v_M+T": "⊗", "α": "×", "ω": "×"},
    "2.49": {"l_M+T": "×", "l_M": "⊗", "l_T": "×"},
    "2.50": {"v_M+T": "×", "v_M": "⊗", "v_T": "×"},
    "2.51": {"l_M": "×", "l_A": "×", "θ_penn": "⊗", "A": "×"},
    "2.52": {"l_M": "×", "l_A": "×", "θ_penn": "×", "A": "(⊗)"},
}
TENDON = {
    "2.30": {"l_T": "⊗", "v_T": "×", "F_T": "×"},
    "2.31": {"l_T": "×", "v_T": "⊗"},
    "2.53": {"F_M": "×", "F_T": "⊗"},
    "2.54": {"F_T": "×", "M_M": "⊗", "r_M": "×"},
}
APONEUROSIS = {
    "2.33": {"l_A": "⊗", "v_A": "×"},
    "2.32": {"l_A": "×", "v_A": "⊗", "F_A": "×"},
    "2.55": {"F_A": "⊗", "θ_penn": "×", "F_F*": "×"},
}
LIMB_ORIGINAL = {
    "2.56": {"α^s": "⊗", "ω^s": "×"},
    "2.57": {"ω^s": "⊗", "F_L": "×", "M_L": "×"},
    "2.59": {"s": "×", "v": "⊗"},
    "2.60": {"v": "×", "a": "⊗"},
    "2.61": {"M_L": "⊗", "M_M": "×"},
    "2.62": {"α^s": "×", "α": "⊗"},
    "2.63": {"F_L": "⊗", "a": "×"},
    "2.65": {"α^s": "×", "s": "⊗"},
}
# 3.1.1 prints no table; the text gives the equations with their variables, and M as the input.
LIMB_TRANSFORMED = {
    "3.10": {"α^s": "⊗", "ω^s": "×"},
    "3.11": {"ω^s": "⊗", "α^s": "×", "M_L": "×", "F_load": "×", "M_load": "×"},
}
TABLES = {
    "sarcomere": SARCOMERE,
    "motor_unit": UNIT,
    "muscle": MUSCLE,
    "tendon": TENDON,
    "aponeurosis": APONEUROSIS,
    "limb_original": LIMB_ORIGINAL,
    "limb_transformed": LIMB_TRANSFORMED,
}
GIVEN = {
    "sarcomere": {"l_S", "v_S", "f_S"},
    "motor_unit": {"F_S", "l_F", "v_F", "f_F", "l_S^max", "F_S^max"},
    "muscle": {"l_A", "v_A", "f_F^max", "U", "F_F", "α", "ω", "l_T", "v_T", "PCSA_F"},
    "tendon": {"F_M", "r_M"},
    "aponeurosis": {"θ_penn", "F_F*"},
    "limb_original": {"M_M"},
    "limb_transformed": {"M_L", "F_load", "M_load"},
}
