"""The connections of a ROS graph. What a node publishes reaches a subscriber only once the two have connected, some time
after both have told the master; what was published before is lost."""
import http.client
import os
import socket
import subprocess
import time
import xmlrpc.client

LIMIT_S = 60.0
STILL_S = 0.5
CALLER = "/ros_graph"


class _Impatient(xmlrpc.client.Transport):
    """A node that hangs is not waited for."""

    def make_connection(self, host):
        return http.client.HTTPConnection(host, timeout=5.0)


def _asked(uri, method, *arguments):
    """The answer to a call of the master's or a node's API; None of a node that is no more."""
    try:
        code, _, value = getattr(xmlrpc.client.ServerProxy(uri, transport=_Impatient()), method)(CALLER, *arguments)
    except (OSError, http.client.HTTPException, socket.timeout):
        return None
    return value if code == 1 else None


def _subscribers_served_by(node, master):
    """{(subscriber, topic)} of the connections out of a node; None if it is no more."""
    uri = _asked(master, "lookupNode", node)
    connections = uri and _asked(uri, "getBusInfo")
    if connections is None:
        return None
    return {(peer, topic) for _, peer, direction, _, topic, *rest in connections if direction == "o" and all(rest[:1])}


def _names():
    """The nodes that the master knows."""
    return {name for kind in _asked(os.environ["ROS_MASTER_URI"], "getSystemState") for _, those in kind
            for name in those}


def connections():
    """What the master knows of, between running nodes: sets of (publisher, subscriber, topic) that are connected, and
    that are not yet."""
    master = os.environ["ROS_MASTER_URI"]
    publishers, subscribers, _ = _asked(master, "getSystemState")
    subscribers = dict(subscribers)
    wanted = {(node, other, topic) for topic, nodes in publishers for node in nodes for other in
              subscribers.get(topic, ()) if other != node}
    served = {node: _subscribers_served_by(node, master) for one in wanted for node in one[:2]}
    wanted = {one for one in wanted if served[one[0]] is not None and served[one[1]] is not None}
    there = {one for one in wanted if one[1:] in served[one[0]]}
    return there, wanted - there


def wait_until_connected(*nodes, limit_s=LIMIT_S):
    """Waits until nodes of these names, or of names that begin with them, run, and all publishers serve all
    subscribers; no other subscription has come for STILL_S then, as that of a node that subscribes once it is heard."""
    end = time.monotonic() + limit_s
    last, since = None, time.monotonic()
    while True:
        there, missing = connections()
        names = _names()
        absent = [node for node in nodes if not any(name.startswith(node) for name in names)]
        if absent or missing or there != last:
            last, since = there, time.monotonic()
        elif time.monotonic() > since + STILL_S:
            return
        if time.monotonic() > end:
            raise TimeoutError(f"waited {limit_s:.0f} s for nodes {absent} and connections {sorted(missing)}")
        time.sleep(0.05)


def go_on(player, *listeners):
    """Lets rosbag play, started with --pause under this node's name, go on once it and all who listen are connected."""
    wait_until_connected(player, *listeners)
    subprocess.run(["rosservice", "call", "--wait", f"{player}/pause_playback", "false"], check=True,
                   stdout=subprocess.DEVNULL)
