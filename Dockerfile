# The simulator in an image of ROS 2: `docker build -t alf_ros .` in the clone (doc/install.md).
# Library versions are pinned in requirements/. numpy1.txt suits messages built for Ubuntu 24.04.
FROM ros:kilted-ros-base

RUN apt-get update \
 && apt-get install -y --no-install-recommends python3-venv \
 && rm -rf /var/lib/apt/lists/*

COPY . /opt/alf_ros
WORKDIR /opt/alf_ros
RUN python3 -m venv --system-site-packages /opt/venv \
 && /opt/venv/bin/pip install --no-cache-dir -c requirements/constraints.txt \
      -r requirements/core.txt -r requirements/numpy1.txt -r requirements/record.txt \
 && /opt/venv/bin/pip install --no-cache-dir --no-deps .
ENV PATH=/opt/venv/bin:$PATH

# Compiles the solver into the image, and fails the build if the node does not run.
WORKDIR /workspace
RUN . /opt/ros/$ROS_DISTRO/setup.sh && python -m alf_ros simulator --duration 1 --no-record

# The entry point of the base image sources ROS 2.
CMD ["python", "-m", "alf_ros", "simulator"]
