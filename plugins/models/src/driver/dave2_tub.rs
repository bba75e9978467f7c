//! The network `dave2_tub`.

super::trained::network! {
    Dave2Tub: "dave2_tub", "3d103491d33223951de52b4684f4cdef0c7fed417662914aa82bbf3beb51b871",
    "Drives with a network that learned from images of `lane` and from a recording of a real DonkeyCar",
    super::trained::DAVE2
}
