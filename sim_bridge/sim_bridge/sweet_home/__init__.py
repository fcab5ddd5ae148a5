"""Models of the Debian package sweethome3d-furniture as meshes and boxes, without MuJoCo.

May import: nothing of the project.
"""
