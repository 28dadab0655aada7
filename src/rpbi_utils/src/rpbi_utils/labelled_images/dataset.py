"""Former location of the names in `rpbi_data.labels.dataset`, kept for compatibility."""

from rpbi_data.labels.dataset import write_labelled_images as write_labelled_images
