"""Names of topics, where nothing else is said."""

REFERENCE_TOPIC = "/imu/reference"
RAW_TOPIC = "/imu/data_raw"
CORRECTED_TOPIC = "/imu/data"
TEMPERATURE_TOPIC = "/imu/temperature"
