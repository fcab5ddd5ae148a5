"""Tables that models know beforehand (zones, layout, links, parents), made from training scenes.

May import: cfnav_core.files, cfnav_core.task, cfnav_core.models, cfnav_core.agent,
cfnav_core.scenes, cfnav_core.words.
"""
