from setuptools import find_packages, setup

package_name = "biofeedback"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    package_data={
        package_name: ["pages/*", "pages/texts/*", "config/*.yaml", "config/courses/*.yaml"]
    },
    install_requires=["setuptools"],
    # colcon test runs pytest where this names it.
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="Ankle perturbation laboratory",
    maintainer_email="ankle.lab@example.com",
    description="The subject's 2-D feedback screen and the operator's page, served to any browser.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "biofeedback = biofeedback.biofeedback_node:main",
        ],
    },
)
