# ROS 2 Jazzy with this workspace built: docker build --tag ankle . && docker run --rm -it ankle
# Written without Docker at hand: it has not been built where it was written. It follows docs/install.md
# step by step; the workflow in .github/workflows/ci.yml builds it.
FROM ros:jazzy

RUN apt-get update \
 && apt-get install --yes --no-install-recommends python3-pip python3-colcon-common-extensions \
 && rm -rf /var/lib/apt/lists/*

WORKDIR /workspace
COPY requirements requirements
# What rosdep lacks. Ubuntu 24.04 asks for the flag (PEP 668); NumPy stays the one of Jazzy's messages.
RUN python3 -m pip install --no-cache-dir --break-system-packages --ignore-installed --requirement requirements/jazzy.txt

COPY . .
RUN apt-get update \
 && rosdep update --rosdistro jazzy \
 && rosdep install --from-paths src --ignore-src --rosdistro jazzy --yes \
 && rm -rf /var/lib/apt/lists/*
RUN . /opt/ros/jazzy/setup.sh && colcon build --merge-install

# The entry point of the base image sources Jazzy; this workspace comes on top of it.
RUN sed -i 's|^exec |source /workspace/install/setup.bash\nexec |' /ros_entrypoint.sh
CMD ["ros2", "launch", "ankle_bringup", "laboratory.launch.py", "graph:=simulated"]
