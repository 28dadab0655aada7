#!/usr/bin/python3
"""Pushes parcels off the belt."""

from my_robot_lab.ros.pusher import main

main()
