"""Moves the stick of a virtual gamepad at random, as a person does: it is held for a while, then let go."""

import random
import time

import rospy
from sensor_msgs.msg import Joy

rospy.init_node("stick", disable_rostime=True)
publisher = rospy.Publisher("joy/virtual", Joy, queue_size=10)
draw = random.Random(7)
while not rospy.is_shutdown():
    right, away, up = (draw.choice((0.0, draw.uniform(-1.0, 1.0))) for _ in range(3))
    for _ in range(draw.randint(5, 30)):
        publisher.publish(Joy(axes=[right, away, 0.0, up, 1.0, 1.0, 0.0, 0.0], buttons=[0] * 11))
        time.sleep(0.03)
