#!/usr/bin/env python3
"""A launch of a node of this package begins with the parameters of its launch files alone: a roscore outlives launches,
and what an earlier one had set beyond them, such as the region of the last patient's CT, must not stay in force."""
import pathlib
import unittest
import xml.etree.ElementTree

import roslaunch.config
import roslaunch.xmlloader

PROJECT = pathlib.Path(__file__).resolve().parents[2]
ROBOT = "robot_description:=" + str(PROJECT / "urdf/integration.urdf")
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


# The arguments of registration.launch, and the parameters that they set.
SET_BY = {
    "fixed_frame": ("registration/fixed_frame", "tf_publisher/fixed_frame", "us_cloud/fixed_frame", "fusion_view/fixed_frame"),
    "ct": ("ct_server/path",), "ct_labels": ("ct_server/labels",),
    "ct_label_table": ("ct_server/label_table",), "data_root": ("ct_server/data_root",),
    "ct_frame": ("ct_server/ct_frame",), "preset": ("registration/preset",), "policy": ("tf_publisher/policy",),
    "restore": ("tf_publisher/restore",), "alignment_file": ("tf_publisher/alignment_file",),
    "proposed_frame": ("tf_publisher/proposed_frame",), "us_frame": ("us_ingest/frame_id",),
    "acquired_frame": ("us_cloud/acquired_frame",), "field_frame": ("us_cloud/field_frame",),
    "save_root": ("fusion_view/save_root",),
}
REMAPPED_BY = {"image_topic": ("us_ingest", "us/image"), "centre_topic": ("fusion_view", "fusion/centre")}


class LaunchFiles(unittest.TestCase):
    def test_parameters_of_earlier_launches_are_cleared(self):
        seen = set()
        for name, *arguments in (("registration.launch", "rviz:=true"), ("registration.launch", "nodelet:=true", "rviz:=true"),
                                 ("integration.launch", ROBOT),
                                 ("overlay.launch",), ("slicer.launch",)):
            config = loaded(name, *arguments)
            own = [node for node in config.nodes if node.name in NODES]
            for node in own:
                self.assertIn(f"/{node.name}/", config.clear_params, f"{name}: {node.name}")
            seen |= {node.name for node in own}
        self.assertEqual(seen, NODES)

    def test_a_calibration_of_an_earlier_launch_is_cleared(self):
        self.assertIn("/calibration/", loaded("integration.launch", ROBOT).clear_params)

    def test_every_node_is_started_again_if_that_is_asked_for(self):
        """A robot's tf and a surgeon's video come from these nodes as well."""
        for name, *arguments in (("registration.launch", "nodelet:=true", "run_us_cloud:=true", "run_fusion_view:=true"),
                                 ("integration.launch", ROBOT), ("overlay.launch",), ("slicer.launch",), ("robot.launch",), ("workstation.launch",)):
            for node in loaded(name, *arguments, "respawn:=true").nodes:
                self.assertTrue(node.respawn, f"{name}: {node.name}")
                self.assertEqual(node.respawn_delay, 2.0, f"{name}: {node.name}")

    def test_launches_of_a_part_hand_on_all_arguments_of_the_whole(self):
        """roslaunch passes over arguments that a file does not declare, without a word."""
        nodes = {"run_" + name for name in ("us_ingest", "ct_server", "registration", "tf_publisher", "us_cloud", "fusion_view")}
        of_ct = {"ct", "ct_labels", "ct_label_table", "data_root", "ct_frame"}
        of_ultrasound = {"us_frame", "images", "image_topic"}
        of_tf = {"policy", "proposed_frame", "alignment_file", "restore"}
        of_rviz = {"rviz", "acquired_frame", "field_frame", "save_root", "centre_topic"}
        whole = declared(PROJECT / "launch/registration.launch") - nodes - {"config", "manager"}
        for name, elsewhere in (("integration.launch", {"nodelet"}), ("robot.launch", of_ct | {"preset"}),
                                ("workstation.launch", of_ultrasound | of_tf | of_rviz)):
            missing = whole - elsewhere - declared(PROJECT / "launch" / name)
            self.assertEqual(missing, set(), name)

    def test_each_argument_sets_its_parameters(self):
        seen = set()
        for name, *arguments in (("registration.launch", "run_us_cloud:=true", "run_fusion_view:=true"),
                                 ("registration.launch", "nodelet:=true", "run_us_cloud:=true", "run_fusion_view:=true"),
                                 ("integration.launch", ROBOT),
                                 ("robot.launch",), ("workstation.launch",)):
            values = {arg: "value_of_" + arg for arg in {**SET_BY, **REMAPPED_BY}.keys() & declared(PROJECT / "launch" / name)}
            config = loaded(name, *arguments, *(f"{arg}:={value}" for arg, value in values.items()))
            nodes = {node.name: dict(node.remap_args) for node in config.nodes}
            for arg, value in values.items():
                for parameter in SET_BY.get(arg, ()):
                    if parameter.split("/")[0] in nodes:
                        self.assertEqual(config.params["/" + parameter].value, value, f"{name}: {arg}")
                        seen.add(parameter)
                if arg in REMAPPED_BY and REMAPPED_BY[arg][0] in nodes:
                    node, topic = REMAPPED_BY[arg]
                    self.assertEqual(nodes[node][topic], value, f"{name}: {arg}")
        self.assertEqual(seen, {parameter for parameters in SET_BY.values() for parameter in parameters})

    def test_a_person_decides_unless_somebody_says_otherwise(self):
        for name, *arguments in (("registration.launch",), ("robot.launch",),
                                 ("integration.launch", ROBOT)):
            config = loaded(name, *arguments)
            for parameter in ("policy", "restore"):
                self.assertEqual(config.params["/tf_publisher/" + parameter].value, "confirm", name)


if __name__ == "__main__":
    unittest.main()
