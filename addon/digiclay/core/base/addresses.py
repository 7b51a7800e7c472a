"""Hosts of network addresses: this machine, or one that others reach."""

import ipaddress


def is_loopback(host: str) -> bool:
    """Return whether a host is this machine; other names are not looked up."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def describe_exposure(host: str, sent: str) -> str:
    """Return a warning about unencrypted data; `sent`: its name and verb; "" for this machine."""
    if is_loopback(host):
        return ""
    return f"Other machines can reach {host}, and {sent} sent without encryption."
