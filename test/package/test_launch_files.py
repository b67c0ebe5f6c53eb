#!/usr/bin/env python3
"""A launch of a node of this package begins with the parameters of its launch files alone: a roscore outlives launches,
and what an earlier one had set beyond them, such as the region of the last patient's CT, must not stay in force."""
import pathlib
import unittest
import xml.etree.ElementTree

import roslaunch.config
import roslaunch.xmlloader

PROJECT = pathlib.Path(__file__).resolve().parents[2]
NODES = {path.stem for path in (PROJECT / "src/nodes").glob("*.cpp")}


def loaded(name, *arguments):
    config = roslaunch.config.ROSLaunchConfig()
    roslaunch.xmlloader.XmlLoader(resolve_anon=False).load(str(PROJECT / "launch" / name), config, verbose=False,
                                                           argv=list(arguments))
    return config


def declared(path):
    """The arguments of a launch file that can be given, each of which its include of registration.launch is given as well."""
    root = xml.etree.ElementTree.parse(path).getroot()
    names = {arg.get("name") for arg in root.findall("arg") if arg.get("value") is None}
    for include in root.findall("include"):
        if include.get("file").endswith("/registration.launch"):
            names &= {arg.get("name") for arg in include.findall("arg")}
    return names


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

    def test_launches_of_a_part_hand_on_all_arguments_of_the_whole(self):
        """roslaunch passes over arguments that a file does not declare, without a word."""
        nodes = {"run_" + name for name in ("us_ingest", "ct_server", "registration", "tf_publisher", "us_cloud", "fusion_view")}
        of_ct = {"ct", "ct_labels", "data_root", "ct_frame"}
        of_ultrasound = {"us_frame", "images", "image_topic"}
        of_tf = {"policy", "proposed_frame", "alignment_file", "restore"}
        of_rviz = {"rviz", "acquired_frame", "field_frame", "save_root", "centre_topic"}
        whole = declared(PROJECT / "launch/registration.launch") - nodes - {"config", "manager"}
        for name, elsewhere in (("integration.launch", {"nodelet"}), ("robot.launch", of_ct | {"preset"}),
                                ("workstation.launch", of_ultrasound | of_tf | of_rviz)):
            missing = whole - elsewhere - declared(PROJECT / "launch" / name)
            self.assertEqual(missing, set(), name)


if __name__ == "__main__":
    unittest.main()
