from setuptools import find_packages, setup

package_name = "rig_emulator"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    # colcon test runs pytest where this names it.
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="Ankle perturbation laboratory",
    maintainer_email="ankle.lab@example.com",
    description="A simulated rig behind the driver's line: its own clock, and faults on request.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "rig_emulator = rig_emulator.rig_emulator_node:main",
        ],
        "ankle_actuator_driver.links": [
            "emulated = rig_emulator.emulated_link:Link",
        ],
    },
)
