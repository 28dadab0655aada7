"""EXOTica's files of one problem, as its users write them."""

from __future__ import annotations

from pathlib import Path

ARM = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf"
SRDF = """<robot name="kuka_lwr">
  <group name="arm"><chain base_link="lwr_arm_0_link" tip_link="lwr_arm_7_link"/></group>
  <group name="wrist"><joint name="lwr_arm_5_joint"/><link name="lwr_arm_7_link"/></group>
  <group name="both"><group name="wrist"/><joint name="lwr_arm_0_joint"/></group>
  <virtual_joint name="world_joint" type="fixed" parent_frame="world_frame" child_link="base"/>
</robot>"""
POSE_MAP = """<EffFrame Name="Pose"><EndEffector>
  <Frame Link="end_effector_ball" Base="Target"/>
</EndEffector></EffFrame>"""
HOME = "0 0.523599 0 -1.57 0 1.0471975511965976 0"
VELOCITY_MAP = f"""<JointVelocityBackwardDifference Name="JointVel">
  <StartState>{HOME}</StartState>
</JointVelocityBackwardDifference>"""


def write_problem(
    folder: Path,
    maps: str = POSE_MAP,
    costs: str = '<Task Task="Pose" Rho="1"/>',
    kind: str = "UnconstrainedEndPoseProblem",
    solver: str = '<IKSolver Name="MySolver" MaxIterations="100"/>',
    links: str = '<Link Name="Target"/>',
    more: str = "<W> 7 6 5 4 3 2 1 </W>",
    group: str = "arm",
    urdf: str = str(ARM),
) -> str:
    """Writes a problem with its SRDF; returns the path."""
    srdf = folder / "arm.srdf"
    srdf.write_text(SRDF)
    path = folder / "problem.xml"
    path.write_text(
        f"""<?xml version="1.0" ?>
<IKSolverDemoConfig>
  {solver}
  <{kind} Name="MyProblem">
    <PlanningScene><Scene>
      <JointGroup>{group}</JointGroup>
      <URDF>{urdf}</URDF>
      <SRDF>{srdf}</SRDF>
      <Links>{links}</Links>
    </Scene></PlanningScene>
    <Maps>{maps}</Maps>
    <Cost>{costs}</Cost>
    {more}
  </{kind}>
</IKSolverDemoConfig>"""
    )
    return str(path)
