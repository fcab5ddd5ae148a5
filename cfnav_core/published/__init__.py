"""Published offline AI2-THOR data as it lies on disk: read, checked, converted, exported.

What leaves this package are ``OfflineScene`` arrays; nothing outside it knows the published files.
"""
