"""Models of the Debian package sweethome3d-furniture as meshes and boxes, without MuJoCo.

``cc0`` has those that come with cfnav.

May import: nothing of the project.
"""
