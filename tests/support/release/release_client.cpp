// A client in C++: tells the md5 sum of each type of TYPES, then asks a simulator that has the robot `iiwa`.
#include <iostream>

#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/Trigger.h>

#include "release_types.h"

template <typename Answer>
void call(const std::string& service, Answer& exchange) {
  if (!ros::service::waitForService(service, ros::Duration(60.0)) || !ros::service::call(service, exchange)) {
    std::cerr << service << " does not answer" << std::endl;
    std::exit(1);
  }
}

int main(int argc, char** argv) {
#define MESSAGE(package, type) \
  std::cout << #package "/" #type " " << ros::message_traits::md5sum<package::type>() << std::endl;
#define SERVICE(package, type) \
  std::cout << #package "/" #type " " << ros::service_traits::md5sum<package::type>() << std::endl;
  TYPES(MESSAGE, SERVICE)

  ros::init(argc, argv, "release_client");
  ros::NodeHandle node;

  ros_pybullet_interface::RobotInfo info;
  call("rpbi/iiwa/robot_info", info);
  std::cout << "robot " << info.response.robot_name << " " << info.response.numDof << std::endl;

  const auto state = ros::topic::waitForMessage<sensor_msgs::JointState>("rpbi/iiwa/joint_states", node);
  std::cout << "joints " << state->name.size() << std::endl;

  ros_pybullet_interface::ResetJointState move;
  move.request.joint_state.name = {state->name.front()};
  move.request.joint_state.position = {0.3};
  move.request.duration = 0.3;
  call("rpbi/iiwa/move_to_joint_state", move);
  std::cout << "moved " << static_cast<int>(move.response.success) << std::endl;

  ros_pybullet_interface::AddPybulletObject add;
  add.request.pybullet_object.object_type = ros_pybullet_interface::PybulletObject::VISUAL;
  add.request.pybullet_object.config = "{name: mark, createVisualShape: {shapeType: GEOM_SPHERE, radius: 0.1}}";
  call("rpbi/add_pybullet_object", add);
  std::cout << add.response.message << std::endl;

  cob_srvs::SetString remove;
  remove.request.data = "mark";
  call("rpbi/remove_pybullet_object", remove);
  std::cout << remove.response.message << std::endl;

  std_srvs::Trigger stop;
  call("rpbi/stop", stop);
  std::cout << stop.response.message << std::endl;
}
