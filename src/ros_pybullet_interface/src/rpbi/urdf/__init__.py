"""URDFs in PyBullet."""
