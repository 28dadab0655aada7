"""Publishes a force on a tool at 250 Hz, as a simulator does; argument: the force along z [N]."""

import sys
import time

import rospy
from geometry_msgs.msg import WrenchStamped

rospy.init_node("pushes_a_tool", anonymous=True)
publisher = rospy.Publisher("haptics/wrench", WrenchStamped, queue_size=1, tcp_nodelay=True)
message = WrenchStamped()
message.wrench.force.z = float(sys.argv[1])
while not rospy.is_shutdown():
    publisher.publish(message)
    time.sleep(0.004)
