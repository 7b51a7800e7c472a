/* Input driver of an X server for tests: a pen with pressure and tilt that nobody holds. XTEST moves it. */
#include <xorg-server.h>
#include <xf86.h>
#include <xf86Module.h>
#include <xf86Xinput.h>
#include <exevents.h>
#include <xserver-properties.h>
#include <X11/Xatom.h>

#define AXES 5
#define BUTTONS 3

static void ring(DeviceIntPtr device, PtrCtrl *control) {}

static int set_up(DeviceIntPtr device) {
    static const char *names[AXES] = {AXIS_LABEL_PROP_ABS_X, AXIS_LABEL_PROP_ABS_Y, AXIS_LABEL_PROP_ABS_PRESSURE,
                                      AXIS_LABEL_PROP_ABS_TILT_X, AXIS_LABEL_PROP_ABS_TILT_Y};
    static const int least[AXES] = {0, 0, 0, -64, -64}, most[AXES] = {65535, 65535, 65535, 63, 63};
    static const char *said[BUTTONS] = {BTN_LABEL_PROP_BTN_LEFT, BTN_LABEL_PROP_BTN_MIDDLE, BTN_LABEL_PROP_BTN_RIGHT};
    unsigned char map[BUTTONS + 1] = {0, 1, 2, 3};
    Atom axes[AXES], buttons[BUTTONS];
    int i;
    for (i = 0; i < AXES; i++) axes[i] = XIGetKnownProperty(names[i]);
    for (i = 0; i < BUTTONS; i++) buttons[i] = XIGetKnownProperty(said[i]);
    if (!InitPtrFeedbackClassDeviceStruct(device, ring)) return BadAlloc;
    if (!InitButtonClassDeviceStruct(device, BUTTONS, buttons, map)) return BadAlloc;
    if (!InitValuatorClassDeviceStruct(device, AXES, axes, GetMotionHistorySize(), Absolute)) return BadAlloc;
    for (i = 0; i < AXES; i++)
        if (!xf86InitValuatorAxisStruct(device, i, axes[i], least[i], most[i], 1000, 1000, 1000, Absolute))
            return BadAlloc;
    if (!InitProximityClassDeviceStruct(device)) return BadAlloc;
    return Success;
}

static int control(DeviceIntPtr device, int what) {
    switch (what) {
    case DEVICE_INIT: return set_up(device);
    case DEVICE_ON: device->public.on = TRUE; break;
    case DEVICE_OFF: device->public.on = FALSE; break;
    }
    return Success;
}

static void read_nothing(InputInfoPtr info) {}

static int pre_init(InputDriverPtr driver, InputInfoPtr info, int flags) {
    info->type_name = "STYLUS";
    info->device_control = control;
    info->read_input = read_nothing;
    info->fd = -1;
    return Success;
}

static void un_init(InputDriverPtr driver, InputInfoPtr info, int flags) { xf86DeleteInput(info, 0); }

_X_EXPORT InputDriverRec TESTPEN = {1, (char *)"testpen", NULL, pre_init, un_init, NULL, NULL};

static void *plug(void *module, void *options, int *error, int *minor) {
    xf86AddInputDriver(&TESTPEN, module, 0);
    return module;
}

static XF86ModuleVersionInfo version = {
    "testpen", MODULEVENDORSTRING, MODINFOSTRING1, MODINFOSTRING2, XORG_VERSION_CURRENT, 1, 0, 0,
    ABI_CLASS_XINPUT, ABI_XINPUT_VERSION, MOD_CLASS_XINPUT, {0, 0, 0, 0}};

_X_EXPORT XF86ModuleData testpenModuleData = {&version, plug, NULL};
