"""Forward-mode differentiation of equations, see `limb_nodes.levels.tangent`."""

from limb_nodes.levels.tangent import (
    UnsupportedCode,
    function_tree,
    global_constants,
    helper_functions,
    tangent_source,
)

__all__ = ["UnsupportedCode", "function_tree", "global_constants", "helper_functions", "tangent_source"]
