from setuptools import find_packages, setup

package_name = "ankle_bringup"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        (f"share/{package_name}/launch", ["launch/laboratory.launch.py"]),
        (f"share/{package_name}/params", ["params/laboratory.yaml"]),
        (f"share/{package_name}/description", ["description/ankle.urdf"]),
        (
            f"share/{package_name}/layouts",
            ["layouts/session_foxglove.json", "layouts/session_plotjuggler.xml"],
        ),
    ],
    package_data={package_name: ["config/*.yaml", "protocols/*.yaml", "scenarios/*.yaml"]},
    install_requires=["setuptools"],
    # colcon test runs pytest where this names it.
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="Ankle perturbation laboratory",
    maintainer_email="ankle.lab@example.com",
    description="Launch files, configurations and the ankle command that runs all of it.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "ankle = ankle_bringup.command_line:main",
        ],
    },
)
