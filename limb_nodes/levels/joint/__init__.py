"""Tissue of joints: ligaments, capsule, skin and what else of a joint resists being turned. Not from the report."""

from limb_nodes.levels.joint import exponential_tissue, linear_tissue, soft_stop

__all__ = ["exponential_tissue", "linear_tissue", "soft_stop"]
