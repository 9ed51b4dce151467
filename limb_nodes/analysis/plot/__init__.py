"""A bag as a picture.

`series.read_series` reads the bag, `panels.columns_of` says what is drawn in which panel, `picture.picture` draws the
panels, `limbs` the limb at a few instants, `thin` keeps long recordings short.
"""
