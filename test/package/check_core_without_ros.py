#!/usr/bin/env python3
"""The core includes no ROS header, and its library needs no ROS library.

Arguments: the project's folder, the library of the core.
"""
import pathlib
import re
import subprocess
import sys

project, library = pathlib.Path(sys.argv[1]), sys.argv[2]
ros_header = re.compile(r'#include\s+[<"](ros|rosbag|tf2\w*|sensor_msgs|geometry_msgs|std_msgs|nodelet|actionlib)/')
offenders = [
    f"{path.relative_to(project)}: {line.strip()}"
    for folder in ("include/us_ct_registration", "src/core", "src/tools")
    for path in sorted((project / folder).rglob("*"))
    # src/tools/ros is compiled in builds with ROS only.
    if path.suffix in (".h", ".cpp") and path.parent != project / "src/tools/ros"
    for line in path.read_text().splitlines()
    if ros_header.match(line)
]
needed = subprocess.run(["objdump", "-p", library], check=True, capture_output=True, text=True).stdout
libraries = re.findall(r"NEEDED\s+(\S+)", needed)
if not libraries:
    sys.exit(f"{library}: objdump names no needed library; the check cannot tell anything")
offenders += [f"{library} needs {name}" for name in libraries
              if re.match(r"lib(ros|tf2|nodelet|actionlib|xmlrpcpp)", name)]
if offenders:
    sys.exit("\n".join(offenders))
print(f"no ROS in the core ({len(libraries)} libraries needed)")
