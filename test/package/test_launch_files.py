#!/usr/bin/env python3
"""A launch of a node of this package begins with the parameters of its launch files alone: a roscore outlives launches,
and what an earlier one had set beyond them, such as the region of the last patient's CT, must not stay in force."""
import pathlib
import unittest

import roslaunch.config
import roslaunch.xmlloader

PROJECT = pathlib.Path(__file__).resolve().parents[2]
NODES = {path.stem for path in (PROJECT / "src/nodes").glob("*.cpp")}


def loaded(name, *arguments):
    config = roslaunch.config.ROSLaunchConfig()
    roslaunch.xmlloader.XmlLoader(resolve_anon=False).load(str(PROJECT / "launch" / name), config, verbose=False,
                                                           argv=list(arguments))
    return config


class LaunchFiles(unittest.TestCase):
    def test_parameters_of_earlier_launches_are_cleared(self):
        seen = set()
        for name, *arguments in (("registration.launch", "rviz:=true"), ("registration.launch", "nodelet:=true", "rviz:=true"),
                                 ("integration.launch", "robot_description:=" + str(PROJECT / "urdf/integration.urdf")),
                                 ("overlay.launch",), ("slicer.launch",)):
            config = loaded(name, *arguments)
            own = [node for node in config.nodes if node.name in NODES]
            for node in own:
                self.assertIn(f"/{node.name}/", config.clear_params, f"{name}: {node.name}")
            seen |= {node.name for node in own}
        self.assertEqual(seen, NODES)


if __name__ == "__main__":
    unittest.main()
