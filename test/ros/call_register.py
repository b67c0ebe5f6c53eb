#!/usr/bin/env python3
"""Calls the service given as argument, as a user's script would; prints status code and translation, m."""
import sys

import rospy
from us_ct_registration.srv import Register

rospy.init_node("caller", anonymous=True)
rospy.wait_for_service(sys.argv[1], timeout=60)
answer = rospy.ServiceProxy(sys.argv[1], Register)()
t = answer.result.transform.translation
print(answer.result.status.code, t.x, t.y, t.z)
