from setuptools import find_packages, setup

package_name = "second_rig"

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
    description="Recordings of a simulated laboratory that shares no code with any other package.",
    license="Apache-2.0",
)
