"""Groups of MuJoCo's geoms: who looks at what."""

VISIBLE_MESH, VISIBLE_PRIMITIVE, VISIBLE_ONLY, TOUCH_ONLY, ROBOT, TOUCH_AND_LASER = range(6)
"""The camera draws the first three; contacts use the second, fourth and last, and the laser the
second and last: no more of what is not seen than its plane cuts."""
