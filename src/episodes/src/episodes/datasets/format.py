"""Former name of the module `rpbi_data.datasets.format`, kept for existing imports."""

from rpbi_data.datasets.format import (
    IMAGES as IMAGES,
)
from rpbi_data.datasets.format import (
    QUATERNION as QUATERNION,
)
from rpbi_data.datasets.format import (
    STAMP_NAMES as STAMP_NAMES,
)
from rpbi_data.datasets.format import (
    Array as Array,
)
from rpbi_data.datasets.format import (
    CameraFeature as CameraFeature,
)
from rpbi_data.datasets.format import (
    DatasetError as DatasetError,
)
from rpbi_data.datasets.format import (
    DatasetFormat as DatasetFormat,
)
from rpbi_data.datasets.format import (
    ExportedEpisode as ExportedEpisode,
)
from rpbi_data.datasets.format import (
    Feature as Feature,
)
from rpbi_data.datasets.format import (
    ImageFrame as ImageFrame,
)
from rpbi_data.datasets.format import (
    Schema as Schema,
)
from rpbi_data.datasets.format import (
    require_room as require_room,
)
from rpbi_data.datasets.format import (
    stamps_of as stamps_of,
)
