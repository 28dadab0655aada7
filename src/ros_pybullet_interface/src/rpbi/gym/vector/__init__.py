"""Many environments at once, in processes of their own."""
