"""URDFs: reading them, faults in their structure, the files that they name, and changed copies."""
