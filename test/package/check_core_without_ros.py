#!/usr/bin/env python3
"""The core and usct include no ROS header and need no ROS library, and none that takes long to load.

Those that a registration rarely needs are linked by modules (src/core/module.h).

Arguments: the project's folder, the library of the core, the program usct.
"""
import pathlib
import re
import subprocess
import sys

project, binaries = pathlib.Path(sys.argv[1]), sys.argv[2:]
ros_header = re.compile(r'#include\s+[<"](ros|rosbag|tf2\w*|sensor_msgs|geometry_msgs|std_msgs|nodelet|actionlib)/')
offenders = [
    f"{path.relative_to(project)}: {line.strip()}"
    for folder in ("include/us_ct_registration", "src/core", "src/tools")
    for path in sorted((project / folder).rglob("*"))
    # src/tools/ros is another program, usct_bag.
    if path.suffix in (".h", ".cpp") and path.parent != project / "src/tools/ros"
    for line in path.read_text().splitlines()
    if ros_header.match(line)
]
count = 0
for binary in binaries:
    needed = subprocess.run(["objdump", "-p", binary], check=True, capture_output=True, text=True).stdout
    libraries = re.findall(r"NEEDED\s+(\S+)", needed)
    if not libraries:
        sys.exit(f"{binary}: objdump names no needed library; the check cannot tell anything")
    count += len(libraries)
    offenders += [f"{binary} needs {name}" for name in libraries
                  if re.match(r"lib(ros|tf2|nodelet|actionlib|xmlrpcpp|us_ct_registration_ros)", name)
                  or re.match(r"lib(ITK|gdcm|hdf5|pagmo|vtk)", name)]
if offenders:
    sys.exit("\n".join(offenders))
print(f"no ROS in the core and usct, and nothing that loads slowly ({count} libraries needed)")
