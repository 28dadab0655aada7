"""Former names of `rpbi_data.labels.dataset`."""

from rpbi_data.labels.dataset import write_labelled_images as write_labelled_images
