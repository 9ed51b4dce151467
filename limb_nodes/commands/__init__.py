"""The subcommands of `limb`, one module each, with `add_parser` and `run`."""
