#!/usr/bin/env python3
"""docs/two_machines.md between two network namespaces: the robot's computer with the master, the replay and robot.launch;
a workstation with workstation.launch."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from node_under_test import unitrun
from test_replay import CLIENT, PACKAGE, Acquisition, System, run, wait_for

IP = shutil.which("ip", path="/usr/sbin:/sbin:/usr/bin:/bin")
PORT = 11311


class Machine:
    """A network namespace with one address."""

    def __init__(self, role, address):
        self.namespace = f"usct_{role}_{os.getpid()}"
        self.address = address
        self.link = f"v{role[:1]}{os.getpid()}"

    def make(self):
        made = subprocess.run([IP, "netns", "add", self.namespace], capture_output=True, text=True)
        if made.returncode != 0:
            raise unittest.SkipTest(f"network namespaces cannot be made here: {made.stderr.strip()}")

    def connect(self):
        run([IP, "link", "set", self.link, "netns", self.namespace], None)
        for command in (["addr", "add", f"{self.address}/30", "dev", self.link], ["link", "set", self.link, "up"],
                        ["link", "set", "lo", "up"]):
            run([IP, "-n", self.namespace, *command], None)

    def remove(self):
        subprocess.run([IP, "netns", "del", self.namespace], capture_output=True)

    def command(self, *arguments):
        return [IP, "netns", "exec", self.namespace, *map(str, arguments)]

    def environment(self, folder, master):
        return dict(os.environ, ROS_MASTER_URI=f"http://{master.address}:{PORT}", ROS_IP=self.address,
                    ROS_HOME=str(folder / self.namespace), ROS_LOG_DIR=str(folder / self.namespace / "log"))


class TestTwoMachines(unittest.TestCase):
    def setUp(self):
        if IP is None:
            self.skipTest("the program ip (package iproute2) is not there")
        self.robot, self.workstation = Machine("robot", "10.213.77.1"), Machine("workstation", "10.213.77.2")
        for machine in (self.robot, self.workstation):
            machine.make()
            self.addCleanup(machine.remove)
        linked = subprocess.run([IP, "link", "add", self.robot.link, "type", "veth", "peer", "name",
                                 self.workstation.link], capture_output=True, text=True)
        if linked.returncode != 0:
            self.skipTest(f"network namespaces cannot be connected here: {linked.stderr.strip()}")
        for machine in (self.robot, self.workstation):
            machine.connect()
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="usct_two_machines_"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.acquisition = Acquisition(self.folder)
        self.system = System(self.folder, self.acquisition)
        self.addCleanup(self.stop_all)

    def stop_all(self):
        for name in ("player", "workstation", "robot", "master"):
            self.system.stop(name)

    def start(self, name, machine, *command):
        self.system.start(name, *machine.command(*command), environment=machine.environment(self.folder, self.robot))

    def run_on(self, machine, *command):
        return run(machine.command(*command), machine.environment(self.folder, self.robot))

    def test_ultrasound_from_the_robot_is_registered_on_the_workstation(self):
        self.start("master", self.robot, "roscore", "-p", PORT)
        wait_for(lambda: subprocess.run(self.workstation.command("rosparam", "set", "use_sim_time", "true"),
                                        env=self.workstation.environment(self.folder, self.robot),
                                        capture_output=True).returncode == 0, "the master, from the workstation")
        self.start("robot", self.robot, "roslaunch", "--wait", PACKAGE, "robot.launch", "fixed_frame:=patient",
                   "policy:=auto")
        self.start("workstation", self.workstation, "roslaunch", "--wait", PACKAGE, "workstation.launch",
                   "fixed_frame:=patient", "preset:=phantom", f"ct:={self.acquisition.ct}")
        self.run_on(self.robot, *CLIENT, "ready")
        self.start("player", self.robot, "rosbag", "play", "--clock", "--keep-alive", "--quiet", "--pause",
                   self.acquisition.next_bag(0), "__name:=player")
        self.run_on(self.robot, *CLIENT, "go_on", "/player")
        self.run_on(self.robot, *CLIENT, "acquired")
        self.run_on(self.robot, *CLIENT, "initial", self.acquisition.initial)
        answer = self.run_on(self.robot, "rosservice", "call", "/register")
        self.assertTrue(answer.startswith("success: True"), answer[:2000])
        targets = self.acquisition.case / "targets_ct.csv"
        for machine in (self.robot, self.workstation):
            print(self.run_on(machine, *CLIENT, "ct_in_tf", targets))
        # The workstation fails, and the robot keeps the CT.
        self.system.stop("workstation")
        print(self.run_on(self.robot, *CLIENT, "ct_in_tf", targets))


if __name__ == "__main__":
    unitrun("two_machines", TestTwoMachines)
