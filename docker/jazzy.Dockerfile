# The nodes and commands on ROS 2 Jazzy:
#   docker build -f docker/jazzy.Dockerfile -t frac_accel:jazzy .
#   docker run --rm --network host --ipc host -v "$PWD/sensor.yaml:/sensor.yaml:ro" frac_accel:jazzy \
#       ros2 run frac_accel corrector --ros-args -p model_file:=/sensor.yaml
# With --ipc host, DDS shares memory with the nodes outside; both sides need the same user.
FROM ros:jazzy

# mcap and plotly have no packages in Ubuntu
ENV PIP_BREAK_SYSTEM_PACKAGES=1 PIP_NO_CACHE_DIR=1
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
WORKDIR /workspace

COPY package.xml src/frac_accel/
# versions are those of the distribution
# hadolint ignore=DL3008,DL3013
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-pip \
    && rosdep update --rosdistro jazzy \
    && rosdep install -y --from-paths src --ignore-src --rosdistro jazzy \
    && pip install plotly \
    && rm -rf /var/lib/apt/lists/*

COPY . src/frac_accel
RUN . /opt/ros/jazzy/setup.bash \
    && colcon build --packages-select frac_accel \
    && rm -rf build log

COPY docker/entrypoint.sh /entrypoint.sh
ENTRYPOINT ["/entrypoint.sh"]
CMD ["frac_accel", "--help"]
