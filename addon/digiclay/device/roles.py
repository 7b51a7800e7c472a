"""Role marks of the objects of a device, independent of their names."""

from __future__ import annotations

#: Property that holds an object's role.
ROLE = "digiclay_role"
#: A housing is an object of its own in older files only. A pin is whatever the bed's nodes draw, and a bake
#: holds baked pins: both stand in no scene.
BED, FINGERTIP, ELLIPSOID, HOUSING, PIN, BAKE = "bed", "fingertip", "ellipsoid", "housing", "pin", "bake"
#: Properties by which a bed holds its fingertip, and that its ellipsoid: what is held is appended along.
FINGER, BALL = "digiclay_fingertip", "digiclay_ellipsoid"
#: Marks what was seen to belong to a bed: only that can be left behind by one. What older files have lying
#: about without a bed stays.
OWNED = "digiclay_owned"
