"""Level of the limb: a planar chain of segments."""
