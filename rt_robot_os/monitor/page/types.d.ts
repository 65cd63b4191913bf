// Made by scripts/page_types.py from the models of the routes; a test compares.

/** A new robot; its token is shown once. */
export interface AddedRobot {
  id: string;
  name: string;
  token: string;
}

/** A new account; ``token`` is that of its one-time link. */
export interface AddedUser {
  id: string;
  name: string;
  role: string;
  people: string[];
  disabled: boolean;
  has_password: boolean;
  created_ns: number;
  token: string;
}

/** An alarm with its history; ``told`` and ``failed`` are channels of notifications. */
export interface AlarmDetails {
  robot: string;
  id: string;
  kinds: string[];
  utc_ns: number;
  seq: number;
  state: string;
  level: string;
  subject: string;
  text: string;
  by: string;
  why: string;
  node: string;
  x: number | null;
  y: number | null;
  opened_ns: number;
  t_ns: number;
  raised_ns: number | null;
  acknowledged_ns: number | null;
  acknowledged_by: string;
  is_open: boolean;
  events: ShownAlarmEvent[];
  told: string[];
  failed: string[];
  notes: ShownNote[];
  media: StoredMedia[];
  codes: Record<string, any>;
  [more: string]: any;
}

/** A row of the audit. */
export interface AuditRow {
  seq: number;
  t_ns: number;
  actor: string;
  name: string;
  role: string;
  address: string;
  action: string;
  object: string;
  details: Record<string, any>;
  [more: string]: any;
}

/** Rows of the audit, the newest first; how many wait for the disk, and how many were lost. */
export interface AuditRows {
  rows: AuditRow[];
  waiting: number;
  lost: number;
}

/** What a check of the audit's chain found. */
export interface AuditVerdict {
  rows: number;
  head: string;
  whole: boolean;
  problems: string[];
  codes: (Record<string, any> | null)[];
}

/** A time without good values; ``to_ns`` is null while it lasts. */
export interface BadStretch {
  from_ns: number;
  to_ns: number | null;
  quality: string;
}

/** An alarm in a list; ``codes`` are those of its texts. */
export interface CodedAlarm {
  robot: string;
  id: string;
  kinds: string[];
  utc_ns: number;
  seq: number;
  state: string;
  level: string;
  subject: string;
  text: string;
  by: string;
  why: string;
  node: string;
  x: number | null;
  y: number | null;
  opened_ns: number;
  t_ns: number;
  raised_ns: number | null;
  acknowledged_ns: number | null;
  acknowledged_by: string;
  is_open: boolean;
  codes: Record<string, any>;
  [more: string]: any;
}

/** The robot's answer; ``codes`` has the code of its text, if it has one. */
export interface CommandResponse {
  ok: boolean;
  text: string;
  codes?: Record<string, any>;
}

/** Who lives with a robot now. */
export interface ConfirmedPeople {
  people: string[];
}

/** It is done. */
export interface Done {
  ok: boolean;
}

/** Until when the access in an emergency lasts. */
export interface EmergencyBegun {
  ends_ns: number;
}

/** How many have ended. */
export interface Ended {
  ended: number;
}

/** The answer to a request that was refused. */
export interface ErrorAnswer {
  detail: ShownProblem;
}

/** The token of a new one-time link. */
export interface InvitationToken {
  token: string;
}

/** What a one-time link is for; ``first``: for the first account. */
export interface Invited {
  first: boolean;
  name: string;
  role: string;
  expires_ns: number;
}

/** A session in the list of an administrator. */
export interface ListedSession {
  id: string;
  user: string;
  name: string;
  created_ns: number;
  seen_ns: number;
  expires_ns: number;
  address: string;
  browser: string;
}

/** A note is stored. */
export interface NoteAdded {
  ok: boolean;
  id: number;
}

/** A session of one's own; ``is_this``: the one that asks. */
export interface OwnSession {
  id: string;
  user: string;
  name: string;
  created_ns: number;
  seen_ns: number;
  expires_ns: number;
  address: string;
  browser: string;
  is_this: boolean;
}

/** How many were revoked. */
export interface Revocation {
  revoked: number;
}

/** What was counted of a robot. */
export interface RobotStatus {
  id: string;
  name: string;
  connected: boolean;
  lost: Record<string, number>;
  counts: Record<string, number>;
}

/** Whether the server runs, and can store records. */
export interface ServerHealth {
  ok: boolean;
  storing: boolean;
}

/** How the server does. */
export interface ServerStatus {
  utc_ns: number;
  started_ns: number;
  connections: Record<string, number>;
  clients: Record<string, number>;
  storing: StoringStatus;
  media: Record<string, number>;
  robots: RobotStatus[];
}

/** Whether there is no account yet. */
export interface SetUpNeeded {
  needed: boolean;
}

/** An event of an alarm, as its robot reported it. */
export interface ShownAlarmEvent {
  t_ns: number;
  seq: number;
  arrived_ns: number;
  codes: Record<string, any>;
  [more: string]: any;
}

/** Who talks with a robot, and since when. */
export interface ShownCall {
  by: string;
  since_ns: number;
}

/** A chart of a sign: parallel lists, an entry for each span that has values. */
export interface ShownChart {
  person: string;
  sign: string;
  unit: string;
  start_ns: number;
  end_ns: number;
  level: string;
  width_ns: number;
  t_ns: number[];
  low: number[];
  mean: number[];
  high: number[];
  count: number[];
  limits: any[];
  alarms: CodedAlarm[];
  bucket_ns: number;
  bad: BadStretch[];
}

/** An access in an emergency. */
export interface ShownEmergency {
  id: number | string;
  user: string;
  name: string;
  person: string;
  reason: string;
  begins_ns: number;
  ends_ns: number;
  is_open: boolean;
}

/** Who lives with a robot; ``people`` is null until they are confirmed once. */
export interface ShownHousehold {
  id: string;
  name: string;
  people: string[] | null;
  suggested: string[];
}

/** How fast a robot may be driven; empty where it may not. */
export interface ShownLimits {
  linear_m_s?: number;
  angular_rad_s?: number;
}

/** The map of a robot; ``cells`` are Base64 of zlib. */
export interface ShownMap {
  sha256: string;
  width: number;
  height: number;
  resolution_m: number;
  origin: number[];
  cells: string;
}

/** A picture, clip or sound in a list; ``here``: the server has its bytes. */
export interface ShownMedia {
  id: number;
  robot: string;
  alarm: string;
  subject: string;
  kind: string;
  size: number;
  width: number;
  height: number;
  t_ns: number;
  here: boolean;
}

/** Where a node of the sensor network is, in m on the map. */
export interface ShownNode {
  id: number;
  name: string;
  x: number;
  y: number;
  z: number;
  person: string;
}

/** A note about an alarm. */
export interface ShownNote {
  id: number;
  by: string;
  text: string;
  t_ns: number;
}

/** A value of a sign. */
export interface ShownObservation {
  id: number;
  robot: string;
  boot: string;
  seq: number;
  person: string;
  code: string;
  value: number | null;
  unit: string;
  quality: string;
  source: string;
  t_ns: number;
  arrived_ns: number;
}

/** A person, and the robots they live with. */
export interface ShownPerson {
  person: string;
  robots: string[];
}

/** Why a request was refused; ``reason``: what the page does about it. */
export interface ShownProblem {
  text: string;
  remedy: string;
  reason?: string;
  codes: Record<string, any>;
  [more: string]: any;
}

/** A robot; what it has not said is missing. */
export interface ShownRobot {
  id: string;
  name: string;
  connected: boolean;
  silent: boolean;
  retired: boolean;
  last_seen_ns: number;
  people: string[];
  clock_offset_s: number;
  cameras?: string[];
  capabilities?: string[];
  nodes?: ShownNode[];
  map?: string;
  limits?: ShownLimits;
  version?: number;
  call?: ShownCall | null;
  story?: ShownStory | null;
  [more: string]: any;
}

/** The session of the page; ``people`` is ``["*"]`` for everybody. */
export interface ShownSession {
  id: string;
  user: string;
  role: string;
  permissions: string[];
  role_permissions: string[];
  people: string[];
  csrf: string;
  locked: boolean;
  emergency: string[];
  emergency_ends_ns: number;
  expires_ns: number;
}

/** What will happen in a demonstration. */
export interface ShownStory {
  what: string;
  person: string;
  at_ns: number;
}

/** A robot that was let in; ``revoked_ns`` is null while it may connect. */
export interface ShownToken {
  id: string;
  name: string;
  created_ns: number;
  revoked_ns: number | null;
}

/** An account; ``people`` is ``["*"]`` for everybody. */
export interface ShownUser {
  id: string;
  name: string;
  role: string;
  people: string[];
  disabled: boolean;
  has_password: boolean;
  created_ns: number;
}

/** A picture, clip or sound of an alarm, as its robot announced it. */
export interface StoredMedia {
  subject: string;
  id: number;
  robot: string;
  media: string;
  alarm: string;
  kind: string;
  file: string;
  sha256: string;
  size: number;
  width: number;
  height: number;
  t_ns: number;
  arrived_ns: number;
  path: string | null;
  stored_ns: number | null;
}

/** How records are stored. */
export interface StoringStatus {
  ok: boolean;
  text: string;
  waiting: number;
  commits: number;
  failures: number;
  records: Record<string, number>;
}

/** What each route answers. */
export interface Answers {
  'GET /api/alarms': CodedAlarm[];
  'GET /api/alarms/{robot}/{alarm}': AlarmDetails;
  'POST /api/alarms/{robot}/{alarm}/notes': NoteAdded;
  'DELETE /api/alarms/{robot}/{alarm}/notes/{note}': Done;
  'GET /api/audit': AuditRows;
  'GET /api/audit/verify': AuditVerdict;
  'GET /api/emergencies': ShownEmergency[];
  'GET /api/media': ShownMedia[];
  'GET /api/observations': ShownObservation[];
  'POST /api/password': ShownSession;
  'GET /api/people': ShownPerson[];
  'GET /api/people/{person}/charts': ShownChart;
  'GET /api/people/{person}/latest': ShownObservation[];
  'GET /api/residents': ShownHousehold[];
  'PUT /api/residents/{robot}': ConfirmedPeople;
  'GET /api/robots': ShownRobot[];
  'GET /api/robots/{robot}': ShownRobot;
  'POST /api/robots/{robot}/commands': CommandResponse;
  'GET /api/robots/{robot}/map': ShownMap;
  'DELETE /api/session': Ended;
  'GET /api/session': ShownSession;
  'POST /api/session': ShownSession;
  'DELETE /api/session/emergency': Ended;
  'POST /api/session/emergency': EmergencyBegun;
  'POST /api/session/unlock': ShownSession;
  'DELETE /api/sessions': Ended;
  'GET /api/sessions': OwnSession[];
  'DELETE /api/sessions/{session}': Ended;
  'GET /api/setup': SetUpNeeded;
  'POST /api/setup': ShownSession;
  'POST /api/setup/check': Invited;
  'GET /api/status': ServerStatus;
  'GET /api/tokens': ShownToken[];
  'POST /api/tokens': AddedRobot;
  'DELETE /api/tokens/{robot}': Revocation;
  'GET /api/users': ShownUser[];
  'POST /api/users': AddedUser;
  'PATCH /api/users/{user}': ShownUser;
  'POST /api/users/{user}/invitation': InvitationToken;
  'DELETE /api/users/{user}/sessions': Ended;
  'GET /api/users/{user}/sessions': ListedSession[];
  'DELETE /api/users/{user}/sessions/{session}': Ended;
  'GET /healthz': ServerHealth;
}
