"""Problems of tasks and costs, and their solution by Gauss and Newton."""
