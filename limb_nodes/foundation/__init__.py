"""What everything else stands on: types of arrays, declared parameters, sections of YAML files, text tables."""
