"""Published offline AI2-THOR data as it lies on disk: read, checked, converted, exported.

What leaves this package are ``OfflineScene`` arrays; nothing outside it knows the published files.

May import: cfnav_core.files, cfnav_core.task, cfnav_core.scenes, cfnav_core.perception.
"""
