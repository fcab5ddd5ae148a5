"""Groups of MuJoCo's geoms: who looks at what."""

VISIBLE_MESH, VISIBLE_PRIMITIVE, VISIBLE_ONLY, TOUCH_ONLY, ROBOT = range(5)
"""The camera draws the first three, laser and contacts use the second and fourth."""
